"""drive.mp4: the car from behind, with the onboard image, the ranges and the active state drawn over it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.interface import CONTROL_RATE_HZ, CORE_LAYOUT, MAX_AGE_S, STEERING, THROTTLE, TURN_MARKER_IDS
from tral_env.recording.video import VideoWriter
from tral_fsm.estimation.sonar import MAX_ECHO_RANGE_M
from tral_fsm.evaluation.episode import Tick
from tral_fsm.report.drive.state_colours import StateColours

Image = NDArray[np.uint8]

WIDTH, HEIGHT = 848, 480
"""Size of the video, px. Source: choice; most of the time of a drive with pictures goes by pixels."""
INSET_WIDTH, INSET_HEIGHT = 288, 216
FPS = 16
"""Frames per second; the video runs in real time."""
INSET_EVERY = 2
"""Number of frames for which an inset stays: 8 insets for a second. Source: choice; near the camera's own rate."""
MAX_PENDING = 40
"""The drive may be so many frames ahead of the video, 2.5 s; then it waits. Source: choice; an inset of a rendered
camera takes 0.9 MB meanwhile."""

NOTHING_SEEN = "no gate or sign in sight"
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_WHITE = (255, 255, 255)
_GREY = (170, 170, 170)
_GREEN = (90, 220, 90)
_RED = (240, 60, 50)
_SIDES = {"left": (-1, 0), "front": (0, -1), "right": (1, 0)}
"""Direction of each ultrasonic in the drawing of the car, px right and down."""


class Stills(Protocol):
    """Pictures that are taken now and rendered later."""

    def take(self, view: str, width: int, height: int) -> Callable[[], Image]:
        """What a view (chase, top or onboard) shows now, as a function that renders it in any thread, RGB."""
        ...

    def close(self) -> None:
        """Free what rendering holds, in the thread that renders."""


class Views(Protocol):
    """An env that renders its views."""

    def render_view(self, view: str, width: int, height: int) -> Image:
        """RGB image (height, width, 3) of a view: chase, top or onboard."""
        ...


class Filmed(Protocol):
    """An env that takes pictures."""

    def stills(self) -> Stills:
        """Pictures of the car."""
        ...


class DriveVideo:
    """Writes a video while the car drives; `drive` takes it as `on_step`.

    A thread renders, draws and encodes the frames beside the drive, which waits only if it is far ahead.

    Example:
        with DriveVideo(path, env.unwrapped) as video:
            drive(env, policy, seed, on_step=video)
    """

    def __init__(self, path: Path, views: Filmed, tones: Mapping[str, str] | None = None) -> None:
        """Write an mp4 file; an existing file is replaced once the video is complete.

        Args:
            path: the file.
            views: the env that gives the pictures.
            tones: colours of states by name, see `StateColours`.

        Raises:
            RenderError: there is no encoder.
        """
        self._stills = views.stills()
        self._path, self._part = path, path.with_suffix(f".part{path.suffix}")
        self._colours = StateColours(given=tones)
        self._last: Tick | None = None
        self._frames = 0
        self._onboard = np.zeros((INSET_HEIGHT, INSET_WIDTH, 3), np.uint8)
        self._every = round(CONTROL_RATE_HZ / FPS)
        self._writer = VideoWriter(self._part, fps=FPS, quality=24, preset="superfast")
        self._is_broken = False
        self._thread = ThreadPoolExecutor(1, "video")
        self._pending: deque[Future[None]] = deque()

    def __call__(self, tick: Tick) -> None:
        """Add a frame if one is due."""
        self._colours.rgb(tick.state)
        self._last = tick
        if tick.index % self._every == 0:
            self._add(tick)

    def hold(self, seconds: float = 1.0) -> None:
        """Show the last tick for some seconds."""
        if self._last is not None:
            self._add(self._last, over=True, frames=round(seconds * FPS))

    def _add(self, tick: Tick, *, over: bool = False, frames: int = 1) -> None:
        """Take the pictures of a tick, and let the thread make frames of them; `over`: the tick is the last one."""
        chase = self._stills.take("chase", WIDTH, HEIGHT)
        is_due = self._frames % INSET_EVERY == 0
        inset = self._stills.take("onboard", INSET_WIDTH, INSET_HEIGHT) if is_due else None
        self._frames += 1
        colour = self._colours.rgb(tick.state)

        def write() -> None:
            if inset is not None:
                self._onboard = inset()
            image = compose(chase(), self._onboard, tick, colour, over)
            try:
                for _ in range(frames):
                    self._writer.add(image)
            except BaseException:
                self._is_broken = True
                raise

        self._pending.append(self._thread.submit(write))
        self._wait(MAX_PENDING)

    def _wait(self, pending: int) -> None:
        """Wait until at most so many frames are pending.

        Raises:
            RenderError: no OpenGL on this machine.
        """
        while len(self._pending) > pending or (self._pending and self._pending[0].done()):
            self._pending.popleft().result()

    def close(self) -> None:
        """Finish the file; without a frame, or after an error of the encoder, no file stays."""
        try:
            self._wait(0)
        finally:
            self._thread.submit(self._stills.close)
            self._thread.shutdown(cancel_futures=False)
            self._finish()

    def _finish(self) -> None:
        try:
            self._writer.close()
            if self._frames and not self._is_broken:
                self._part.replace(self._path)
        finally:
            self._part.unlink(missing_ok=True)

    def __enter__(self) -> DriveVideo:
        """Return the video."""
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        """Hold the last picture if the drive has ended, and finish the file."""
        try:
            if kind is None:
                self.hold()
        finally:
            self.close()


def compose(chase: Image, onboard: Image, tick: Tick, colour: tuple[int, int, int], over: bool = False) -> Image:
    """Draw inset, state and readings over a chase view.

    Args:
        chase: (HEIGHT, WIDTH, 3) RGB, which is changed.
        onboard: (h, w, 3) RGB.
        tick: the tick to show.
        colour: colour of the active state, RGB.
        over: whether the tick is the last one; without an outcome it is a timeout.

    Returns:
        `chase`.
    """
    _draw_inset(chase, onboard)
    _draw_state(chase, tick, colour)
    _draw_outcome(chase, tick, over)
    readings = dict(zip(CORE_LAYOUT.names, tick.observation, strict=False))
    _draw_ranges(chase, readings)
    _draw_gauges(chase, tick, readings)
    return chase


def _shade(image: Image, left: int, top: int, right: int, bottom: int) -> None:
    part = image[top:bottom, left:right]
    part[:] = (part * 0.45).astype(np.uint8)


def _text(
    image: Image,
    text: str,
    at: tuple[int, int],
    size: float = 0.5,
    colour: tuple[int, int, int] = _WHITE,
    weight: int = 1,
) -> None:
    cv2.putText(image, text, at, _FONT, size, colour, weight, cv2.LINE_AA)


def _draw_inset(image: Image, onboard: Image) -> None:
    height, width = onboard.shape[:2]
    left, top = WIDTH - width - 12, 12
    image[top - 2 : top + height + 2, left - 2 : left + width + 2] = 255
    image[top : top + height, left : left + width] = onboard


def _draw_state(image: Image, tick: Tick, colour: tuple[int, int, int]) -> None:
    info = tick.info
    _shade(image, 12, 12, 360, 86)
    cv2.rectangle(image, (12, 12), (24, 86), colour, cv2.FILLED)
    cv2.rectangle(image, (12, 12), (24, 86), _WHITE, 1)  # dark colours stand out from the shade
    _text(image, tick.state or "no states", (34, 40), 0.75, weight=2)
    # A real car does not know its progress, and says how far it has driven.
    way = f"{100 * info['progress']:3.0f} %" if "progress" in info else f"{info['distance_m']:.1f} m"
    line = f"{info['time_s']:5.1f} s   {way}   {info['speed_mps']:.2f} m/s"
    if info.get("gates_total"):
        line += f"   gates {info['gates_passed']}/{info['gates_total']}"
    _text(image, line, (34, 70))


def _draw_outcome(image: Image, tick: Tick, over: bool) -> None:
    ended = [word for word in ("success", "collision", "missed_gate") if tick.info.get(word)]
    if ended or (over and "success" in tick.info):
        word = ended[0] if ended else "timeout"
        colour = _GREEN if word == "success" else _RED
        _text(image, word.replace("_", " ").upper(), (WIDTH // 2 - 110, HEIGHT // 2), 1.4, colour, 3)


def _draw_ranges(image: Image, readings: dict[str, float]) -> None:
    """Draw the car from above with its three ranges, to scale (40 px for a metre, up to 2.5 m) and in figures."""
    _shade(image, 12, HEIGHT - 182, 262, HEIGHT - 12)
    x, y = 137, HEIGHT - 48
    cv2.rectangle(image, (x - 6, y - 12), (x + 6, y + 12), _WHITE, cv2.FILLED)
    for side, (right, down) in _SIDES.items():
        metres = readings[f"ultrasonic_{side}"]
        echo = metres < MAX_ECHO_RANGE_M
        reach = int(40 * min(metres, 2.5))
        ends = (x + right * (8 + reach), y + down * (14 + reach))
        cv2.line(image, (x + right * 8, y + down * 14), ends, _GREEN if echo else _GREY, 2, cv2.LINE_AA)
        label = f"{metres:.2f}" if echo else "no echo"
        at = {"left": (20, y - 12), "front": (x + 10, y - 90), "right": (212, y - 12)}[side]
        _text(image, label, at, 0.45, _GREEN if echo else _GREY)
    _text(image, "ultrasonics [m]", (20, HEIGHT - 164), 0.42, _GREY)


def _draw_gauges(image: Image, tick: Tick, readings: dict[str, float]) -> None:
    """Draw steering and throttle as bars, and the last detection."""
    left, top = WIDTH - 272, HEIGHT - 102
    _shade(image, left, top, WIDTH - 12, HEIGHT - 12)
    for row, (name, value, sign) in enumerate(
        (("steering", tick.action[STEERING], -1), ("throttle", tick.action[THROTTLE], 1))
    ):
        y = top + 24 + 26 * row
        _text(image, name, (left + 10, y), 0.45)
        middle = left + 170
        cv2.line(image, (middle, y - 12), (middle, y + 4), _GREY, 1)
        cv2.rectangle(image, (middle, y - 9), (middle + int(70 * sign * value), y + 1), _GREEN, cv2.FILLED)
    line = sight_line(readings)
    _text(image, line, (left + 10, top + 78), 0.42, _GREY if line == NOTHING_SEEN else _WHITE)


def sight_line(readings: Mapping[str, float]) -> str:
    """The last detection of a gate or of a single marker, the newer of the two, and its age."""
    gate, marker = readings["gate_age"], readings["marker_age"]
    if min(gate, marker) >= MAX_AGE_S:
        return NOTHING_SEEN
    what, age = ("gate", gate) if gate <= marker else ("marker", marker)
    number, x, y = (readings[f"{what}_{name}"] for name in ("id", "x", "y"))
    if what == "gate":
        return f"gate {number:.0f}: {x:.2f} m ahead, {y:+.2f}; {age:.1f} s ago"
    name = "sign" if int(number) in TURN_MARKER_IDS.values() else "marker"
    return f"{name} {number:.0f}, {math.hypot(x, y):.1f} m; {age:.1f} s ago"
