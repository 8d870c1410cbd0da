"""The page: a server that shows frames to any number of browsers, and hands their wishes on."""

from __future__ import annotations

import contextlib
import html
import io
import math
import threading
import time
import warnings
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
import viser
from numpy.typing import NDArray

from tral_env.errors import RenderError
from tral_fsm.live.address import address, free_port
from tral_fsm.live.charts import Charts
from tral_fsm.live.controls import Controls, ReplayControls
from tral_fsm.live.drawing import Drawing, plain
from tral_fsm.live.frame import Frame
from tral_fsm.live.guard import guard
from tral_fsm.live.numbers import Numbers
from tral_fsm.live.replay import Replay
from tral_fsm.live.scene import GHOST, PATHS, Scene

Image = NDArray[np.uint8]
RATE_HZ = 25.0
"""The scene is sent so often."""
_CHARTS_EVERY, _TEXT_EVERY = 12, 3
"""Charts and words are sent with every so many scenes."""
_IDLE_S = 0.2
"""Without a browser the page is renewed so often, so that one that comes sees the path."""
_VIEWS = ("behind the car", "around the car", "above the car", "free")
_LOST_RACE = "deque mutated during iteration"
"""The library wakes the thread that sends without a lock, and fails if that one just moved; the next frame helps."""
_TURN = 0.12
"""Share of the car's turn by which the view from behind follows in each scene."""


class Source(Protocol):
    """Where frames come from."""

    @property
    def frame(self) -> Frame:
        """The moment that is shown."""
        ...


class Page:
    """Shows a source until it is closed, from a thread of its own."""

    def __init__(
        self,
        source: Any,
        *,
        host: str = "127.0.0.1",
        port: int = 8080,
        token: str | None = None,
        drivers: Sequence[str] = (),
        annotate: Callable[[Image], Image] | None = None,
    ) -> None:
        """Serve the page.

        Args:
            source: gives frames; one that takes orders is a `LiveDrive`.
            host: address to listen on.
            port: the first port to try; 0: any.
            token: what a browser must show; None: nothing, where only this computer can reach the page.
            drivers: names of the policies that can be chosen.
            annotate: draws into the camera's picture what is seen in it.

        Raises:
            ConfigError: this computer cannot listen there.
        """
        self._source, self._annotate = source, annotate
        warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)
        port = free_port(host, port)  # the library would wait for ever
        with contextlib.redirect_stdout(io.StringIO()):  # it greets
            self.server = viser.ViserServer(host, port, label="tral live", verbose=False)
        guard(self.server, token)
        self.url = address(host, self.server.get_port(), token)
        """What is typed into a browser."""
        self.scene = Scene(self.server)
        self._build(drivers)
        self._episode = -1
        self._picture: Any = None
        self._yaw = 0.0
        self._ends = threading.Event()
        self._count = 0
        self._thread = threading.Thread(target=self._paint, name="tral live", daemon=True)
        self._thread.start()

    def _build(self, drivers: Sequence[str]) -> None:
        """Make the panels."""
        gui, frame = self.server.gui, self._source.frame
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        order = getattr(self._source, "order", None)
        self.status = gui.add_markdown("")
        self.legend = gui.add_html("")
        self.view = gui.add_dropdown("view", _VIEWS)
        tabs = gui.add_tab_group()
        self.controls: Controls | ReplayControls | None = None
        self.numbers: Numbers | None = None
        with tabs.add_tab("Drive"):
            if (stop := getattr(self._source, "emergency_stop", None)) is not None:
                self.stop = gui.add_button("STOP THE CAR", color="red", icon=viser.Icon.HAND_STOP)
                self.stop.on_click(lambda _: stop())
                gui.add_command("stop the car", hotkey="space").on_trigger(lambda _: stop())
            elif order is not None:
                self.controls = Controls(gui, order, frame, drivers, self._source.keys)
            elif isinstance(self._source, Replay):
                self.controls = ReplayControls(gui, self._source)
        left = gui.add_panel()
        left.dock_left()
        left.set_width(400)
        with left.add_tab("Machine"):
            self.drawing = Drawing(gui)
            if order is not None:
                self.numbers = Numbers(gui, order)
        with left.add_tab("Charts"):
            self.charts = Charts(gui)
        with left.add_tab("Camera"):
            self.camera = gui.add_image(
                np.zeros((240, 320, 3), np.uint8), label="what the car's camera shows", jpeg_quality=75
            )

    def _paint(self) -> None:
        while not self._ends.is_set():
            begun = time.monotonic()
            try:
                self.show(self._source.frame)
            except RuntimeError as error:
                if _LOST_RACE not in str(error):
                    raise
            period = 1.0 / RATE_HZ if self.server.get_clients() else _IDLE_S
            self._ends.wait(max(period - (time.monotonic() - begun), 0.005))

    def show(self, frame: Frame) -> None:
        """Show a moment to every browser."""
        self._count += 1
        first = frame.cars[0]
        if frame.episode != self._episode:
            self._episode = frame.episode
            self._yaw = first.pose[2] if first.pose is not None else 0.0
            self.scene.restart()
        if frame.as_loaded is not self._drawn or self._count == 1:
            self._drawn = frame.as_loaded
            self.drawing.draw(frame.as_loaded)
        self.charts.history.add(first)
        with self.server.atomic():
            self.scene.show(frame, self.drawing.tones)
            if self._count % _TEXT_EVERY == 0:
                self.status.content = status(frame)
                if self.legend.content != (told := legend(frame)):
                    self.legend.content = told
                self.drawing.show(first)
                self._show_camera(frame)
            if self._count % _CHARTS_EVERY == 0:
                self.charts.show()
        if self.controls is not None:
            self.controls.show(frame)
        if self.numbers is not None:
            self.numbers.show(frame)
        self._follow(frame)

    _drawn: Any = None

    def _show_camera(self, frame: Frame) -> None:
        if frame.picture is None or frame.picture is self._picture or not self.server.get_clients():
            return
        self._picture = frame.picture
        try:
            image = frame.picture()
        except RenderError:
            return
        self.camera.image = image if self._annotate is None else self._annotate(image)

    def _follow(self, frame: Frame) -> None:
        """Move the eyes of the browsers along with the car."""
        pose, view = frame.cars[0].pose, self.view.value
        if pose is None or view == "free":
            return
        x, y, yaw = pose
        self._yaw += _TURN * ((yaw - self._yaw + math.pi) % (2.0 * math.pi) - math.pi)
        cos, sin = math.cos(self._yaw), math.sin(self._yaw)
        for client in self.server.get_clients().values():
            eye = client.camera
            if view == "behind the car":
                look, place = (x + 0.8 * cos, y + 0.8 * sin, 0.1), (x - 1.9 * cos, y - 1.9 * sin, 1.35)
            elif view == "above the car":
                look, place = (x, y, 0.0), (x - 0.01 * cos, y - 0.01 * sin, 7.0)
            else:
                look = (x, y, 0.1)
                place = tuple(np.asarray(eye.position) - np.asarray(eye.look_at) + look)
            with contextlib.suppress(UserWarning):  # the browser has just gone
                eye.position, eye.look_at = place, look

    def close(self) -> None:
        """Stop serving."""
        self._ends.set()
        self._thread.join(20.0)
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()


def status(frame: Frame) -> str:
    """The moment in words, as Markdown."""
    lines = [f"**{plain(frame.title)}**"]
    for car in frame.cars:
        told = [f"{car.time_s:.1f} s", *([plain(car.state)] if car.state else [])]
        if not math.isnan(car.speed_mps):
            told.append(f"{car.speed_mps:.2f} m/s")
        if not math.isnan(car.progress):
            told.append(f"{car.progress:.0%} of the way")
        if car.gates[1]:
            told.append(f"gate {car.gates[0]} of {car.gates[1]}")
        lines.append(f"{plain(car.name)}: {', '.join(told)}{f' - **{plain(car.ended)}**' if car.ended else ''}")
    if frame.paused:
        lines.append("**paused**")
    lines += [plain(text) for text in (frame.lateness, frame.notice) if text]
    return "\n\n".join(lines)


def legend(frame: Frame) -> str:
    """Whose car has which colour, as HTML; empty where there is one car alone."""
    rows = [] if len(frame.cars) < 2 else [(PATHS[k % len(PATHS)], car.name) for k, car in enumerate(frame.cars)]
    if frame.ghost is not None:
        rows.append((GHOST, f"ghost: the best drive so far ({frame.ghost.name})"))
    box = "display:inline-block;width:1em;height:1em;margin-right:.5em;vertical-align:-.1em"
    return "".join(
        f'<div style="padding:0 1em"><span style="{box};background:rgb{colour}"></span>{html.escape(name)}</div>'
        for colour, name in rows
    )
