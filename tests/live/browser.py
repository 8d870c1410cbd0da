"""A browser without a screen: it speaks the page's protocol, keeps what it is sent, and presses and moves things."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Self
from urllib.parse import parse_qs, urlsplit

import msgspec
import viser
import zstandard
from viser import _messages as messages
from websockets.sync.client import connect

_PATIENCE_S = 60.0


class Browser:
    """One connection to a page."""

    def __init__(self, url: str, **headers: str) -> None:
        """Open the address that the program tells."""
        parts = urlsplit(url)
        socket = parse_qs(parts.query).get("websocket", [f"ws://{parts.netloc}"])[0]
        self.received = 0
        """Bytes that came."""
        self.parts: dict[str, dict[str, Any]] = {}
        """What stands in the panels: uuid -> what it is."""
        self.scene: set[str] = set()
        """Names of what is in the scene."""
        self.errors: list[str] = []
        """What a browser would tell in its console."""
        self.files: list[bytes] = []
        """Files that were downloaded."""
        protocol: Any = f"viser-v{viser.__version__}"
        self._line = connect(socket, subprotocols=[protocol], max_size=None, additional_headers=headers)
        eye = messages.ViewerCameraMessage(
            (1.0, 0.0, 0.0, 0.0), (0.0, -3.0, 3.0), 1.0, 0.1, 100.0, 600, 800, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
        )
        self._send(eye)

    def _send(self, message: Any) -> None:
        self._line.send(msgspec.msgpack.encode(message.as_serializable_dict()))

    def take(self, seconds: float) -> None:
        """Take what comes in so long."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            try:
                data = self._line.recv(timeout=left)
            except TimeoutError:
                return
            assert isinstance(data, bytes)
            self.received += len(data)
            size = int.from_bytes(data[8:16], "little")
            told = msgspec.msgpack.decode(zstandard.decompress(data[16 : 16 + size]))
            for message in told["messages"]:
                self._take(message)

    def _take(self, message: dict[str, Any]) -> None:
        kind, uuid = message["type"], message.get("uuid", "")
        if kind == "GuiUpdateMessage":
            if uuid not in self.parts:
                self.errors.append(f"Tried to update non-existent component {uuid}")
                return
            self.parts[uuid].update(message["updates"])
        elif kind == "GuiRemoveMessage":
            self.parts.pop(uuid, None)
        elif kind.startswith("Gui") and "props" in message:
            self.parts[uuid] = {"kind": kind, "value": message.get("value"), **message["props"]}
        elif kind == "RemoveSceneNodeMessage":
            self.scene = {name for name in self.scene if not f"{name}/".startswith(f"{message['name']}/")}
        elif "name" in message and "props" in message:
            self.scene.add(message["name"])
        elif kind == "FileTransferPart":
            self.files.append(message["content"])

    def until(self, holds: Callable[[], bool]) -> None:
        """Take what comes until something holds."""
        end = time.monotonic() + _PATIENCE_S
        while not holds():
            assert time.monotonic() < end, f"it never came; there is {sorted(map(str, self.labels))}"
            self.take(0.05)

    def until_open(self) -> None:
        """Take what comes until there is something to see."""
        self.until(lambda: bool(self.parts))

    @property
    def labels(self) -> list[str]:
        """What stands on the buttons, sliders and lists."""
        return [part["label"] for part in self.parts.values() if part.get("label")]

    @property
    def words(self) -> str:
        """All texts."""
        return "\n".join(str(part.get("_markdown") or part.get("content") or "") for part in self.parts.values())

    def find(self, label: str) -> str:
        """The part with this label."""
        self.until(lambda: label in self.labels)
        return next(uuid for uuid, part in self.parts.items() if part.get("label") == label)

    def value(self, label: str) -> Any:
        """What a slider or a list stands at."""
        return self.parts[self.find(label)]["value"]

    def set(self, label: str, value: Any) -> None:
        """Move a slider, choose from a list, type."""
        uuid = self.find(label)
        self.parts[uuid]["value"] = value
        self._send(messages.GuiUpdateMessage(uuid, {"value": value}))

    def press(self, label: str) -> None:
        """Press a button."""
        self._send(messages.GuiUpdateMessage(self.find(label), {"value": True}))

    def close(self) -> None:
        """Close the window."""
        self._line.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
