"""Headless Chromium by its DevTools protocol: windows in which a script clicks, types, and takes pictures.

WebGL is drawn in software, so a picture of the page of `tral live` takes a second or so.
"""

from __future__ import annotations

import base64
import itertools
import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, Self

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
"""Path of the browser; None: there is none."""
PATIENCE_S = 120.0
"""Whatever a busy computer does not show after so long never comes."""
_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--no-first-run",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--remote-debugging-port=0",
    "--remote-allow-origins=*",
)
_HELPERS = """
window.clicked = null;
addEventListener("click", event => { window.clicked = event.target; }, true);
window.by = (text, selector) => [...document.querySelectorAll(selector)].find(
    one => one.textContent.trim() === text && one.getBoundingClientRect().width > 0);
window.beside = (label, selector) => {
    let at = by(label, "label, span, p, div");
    while (at && !at.querySelector(selector)) at = at.parentElement;
    return at && at.querySelector(selector);
};
"""


_PLACE = """(() => {
    const one = %s;
    if (!one) return null;
    one.scrollIntoView({block: "center", behavior: "instant"});
    const at = one.getBoundingClientRect(), x = at.x + at.width / 2, y = at.y + at.height / 2;
    return one.contains(document.elementFromPoint(x, y)) ? [x, y] : null;
})()"""
"""Middle of an element, once nothing lies above it."""


class Chromium:
    """A browser with as many windows as are opened, within its ``with`` block."""

    def __init__(self, width: int = 1000, height: int = 700) -> None:
        """Choose the size of the windows, px."""
        self._size = width, height
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        """Start the browser."""
        assert PROGRAM is not None, "no chromium on this computer"
        folder = self._stack.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True))
        size = "--window-size={},{}".format(*self._size)
        self._process = subprocess.Popen(
            [PROGRAM, *_FLAGS, size, f"--user-data-dir={folder}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self._stack.callback(self._end)
        told = Path(folder, "DevToolsActivePort")
        until(told.exists)
        until(lambda: len(told.read_text().split()) == 2)
        port, path = told.read_text().split()
        self._port, self._browser = int(port), _Line(f"ws://127.0.0.1:{port}{path}")
        self._stack.callback(self._browser.close)
        return self

    def _end(self) -> None:
        self._process.terminate()
        self._process.wait(PATIENCE_S)

    def __exit__(self, *_: object) -> None:
        """End it, with all windows."""
        self._stack.close()

    def window(self, url: str) -> Window:
        """Open a page in a window of its own."""
        made = self._browser.call("Target.createTarget", url="about:blank", newWindow=True)
        window = Window(f"ws://127.0.0.1:{self._port}/devtools/page/{made['targetId']}")
        self._stack.callback(window.close)
        window.open(url)
        return window


class _Line:
    """A connection that speaks the DevTools protocol."""

    def __init__(self, url: str) -> None:
        self._socket, self._numbers = connect(url, max_size=None), itertools.count(1)
        self.errors: list[str] = []
        """What the console told as errors."""

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the DevTools protocol."""
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            told = json.loads(self._socket.recv(timeout=PATIENCE_S))
            if told.get("id") == number:
                assert "error" not in told, told["error"]
                result: dict[str, Any] = told["result"]
                return result
            self._note(told)

    def _note(self, event: dict[str, Any]) -> None:
        """Remember what the console tells as an error."""
        told, of = event.get("params", {}), event.get("method")
        if of == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(told["exceptionDetails"])[:500])
        elif of == "Runtime.consoleAPICalled" and told["type"] in ("error", "assert"):
            self.errors.append(json.dumps(told["args"])[:500])
        elif of == "Log.entryAdded" and told["entry"]["level"] == "error":
            self.errors.append(json.dumps(told["entry"])[:500])

    def close(self) -> None:
        """Disconnect."""
        self._socket.close()


class Window(_Line):
    """A window: what a person sees and does in it."""

    def __init__(self, url: str) -> None:
        super().__init__(url)
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setFocusEmulationEnabled", enabled=True)  # one that is hidden would draw nothing
        self.call("Page.addScriptToEvaluateOnNewDocument", source=_HELPERS)

    def open(self, url: str) -> None:
        """Go to a page."""
        self.call("Page.navigate", url=url)

    def ask(self, expression: str) -> Any:
        """Value of an expression of JavaScript."""
        told = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in told, told
        return told["result"].get("value")

    def until(self, expression: str) -> None:
        """Wait until an expression of JavaScript holds."""
        until(lambda: bool(self.ask(expression)), expression)

    def click(self, element: str) -> None:
        """Click into the middle of an element that an expression of JavaScript gives, once it is there."""
        place: list[float] = []

        def is_clicked() -> bool:
            """Whether a click came there: one into a page that moves at that moment is lost."""
            before = list(place)
            place[:] = self.ask(_PLACE % element) or ()
            if not place or place != before:
                return False
            self.ask("window.clicked = null")
            self.click_at(*place)
            return bool(self.ask("window.clicked !== null"))

        until(is_clicked, element)

    def click_at(self, x: float, y: float) -> None:
        """Click with the mouse at a place, px."""
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            buttons = {} if kind == "mouseMoved" else {"button": "left", "clickCount": 1}
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **buttons)

    def press(self, text: str) -> None:
        """Press the button with this text."""
        self.click(f'by({json.dumps(text)}, "button")')

    def choose(self, label: str, option: str) -> None:
        """Choose from a list by clicks."""
        self.click(f'beside({json.dumps(label)}, "input")')
        self.click(f'by({json.dumps(option)}, "[role=option]")')

    def type(self, label: str, text: str) -> None:
        """Replace what stands in a field."""
        field = f'beside({json.dumps(label)}, "input")'
        self.click(field)
        self.ask(f"{field}.select()")
        self.call("Input.insertText", text=text)

    def key(self, key: str) -> None:
        """Press a key that is no letter."""
        codes = {"ArrowRight": 39, "ArrowLeft": 37, "End": 35, "Home": 36}
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=codes[key])

    def shot(self) -> bytes:
        """A picture of the window as a PNG file."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def close(self) -> None:
        """Close the window; a second call does nothing."""
        with suppress(WebSocketException):  # it is closed already
            self.call("Page.close")
        super().close()


def until(holds: Callable[[], bool], what: str = "it") -> None:
    """Wait until something holds."""
    end = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < end, f"{what} never came"
        time.sleep(0.1)
