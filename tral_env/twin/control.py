"""Talking to a running twin: JSON lines over a socket in its folder.

A request is ``{"do": "status"}``, ``{"do": "reset", "seed": 3}``, ``{"do": "fault", "name": ...}`` or
``{"do": "down"}``; the answer is what was asked for, or ``{"error": ...}``.
"""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Callable, Mapping
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from tral_env.errors import ConfigError, HardwareError, TralError, nearest

CONTROL_SOCKET = "control"
"""Name of the socket in the twin's folder."""
_PATIENCE_S = 15.0
Request = Mapping[str, Any]
Answer = Callable[[Request], Any]


class ControlServer:
    """Answers requests, each connection in a thread of its own."""

    def __init__(self, path: Path, answers: Mapping[str, Answer]) -> None:
        """Listen.

        Args:
            path: of the socket; one that a dead twin left is replaced.
            answers: name -> what answers it.

        Raises:
            HardwareError: a twin listens there already, or nobody can.
        """
        self._path, self._answers = path, answers
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._listen()
        except HardwareError:
            self._listener.close()
            raise
        except OSError as error:
            self._listener.close()
            raise HardwareError(f"no twin can listen at {path}: {error}: give it another folder or name") from error
        threading.Thread(target=self._accept, daemon=True).start()

    def _listen(self) -> None:
        path = self._path
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists():
            if _answers(path):
                raise HardwareError(
                    f"a twin runs already at {path.parent}: end it by `tral twin down --name {path.parent.name}`, or "
                    "give another --name (`tral ros`: another --namespace)"
                )
            path.unlink()
        self._listener.bind(str(path))
        self._listener.listen()

    def close(self) -> None:
        """Stop listening, and remove the socket."""
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._path.unlink(missing_ok=True)

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        with connection, connection.makefile("rwb") as stream, suppress(OSError):
            for line in stream:
                stream.write(json.dumps(self._answer(line)).encode() + b"\n")
                stream.flush()

    def _answer(self, line: bytes) -> Any:
        try:
            request = json.loads(line)
            name = request.get("do")
            if name not in self._answers:
                raise ConfigError(f"unknown request '{name}': {nearest(name, self._answers)}")
            return self._answers[name](request)
        except KeyError as error:
            return {"error": f"the request lacks {error}"}
        except (TralError, ValueError, TypeError, AttributeError) as error:
            return {"error": str(error)}


class ControlConnection:
    """A connection to a twin, for one request after the other."""

    def __init__(self, folder: Path) -> None:
        """Connect to the twin whose files lie in a folder.

        Raises:
            HardwareError: no twin answers there.
        """
        self._folder, self._socket = folder, socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(_PATIENCE_S)
        try:
            self._socket.connect(str(folder / CONTROL_SOCKET))
        except OSError as error:
            self._socket.close()
            raise self._silent(error) from error
        self._answers = self._socket.makefile("rb")

    def _silent(self, error: OSError) -> HardwareError:
        return HardwareError(
            f"no twin answers at {self._folder} ({error.strerror or error}): start one by `tral twin up`"
        )

    def ask(self, **request: Any) -> Any:
        """Ask the twin.

        Raises:
            HardwareError: it does not answer any more.
            ConfigError: it refuses.
        """
        try:
            self._socket.sendall(json.dumps(request).encode() + b"\n")
            text = self._answers.readline()
        except OSError as error:
            raise self._silent(error) from error
        if not text:
            raise HardwareError(f"the twin at {self._folder} has ended")
        answer = json.loads(text)
        if isinstance(answer, dict) and "error" in answer:
            raise ConfigError(answer["error"])
        return answer

    def close(self) -> None:
        """Disconnect."""
        self._answers.close()
        self._socket.close()


def ask(folder: Path, **request: Any) -> Any:
    """Ask the twin whose files lie in a folder.

    Raises:
        HardwareError: no twin answers there, or it ends.
        ConfigError: it refuses.
    """
    with closing(ControlConnection(folder)) as line:
        return line.ask(**request)


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as line:
        return line.connect_ex(str(path)) == 0
