"""What is drawn over the course: fans of the ultrasonics, the path so far, and what the machine believes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from tral_env.config import UltrasonicConfig
from tral_env.geometry import FRONT_SONAR_X_M, LENGTH_M, MARKER_BOARD_WIDTH_M, SIDE_SONAR_X_M, SIDE_SONAR_Y_M, WIDTH_M
from tral_env.interface import NO_ECHO_M
from tral_env.se2 import Pose, compose, to_outer
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.live.frame import CarFrame

Array = NDArray[np.float64]
Colour = tuple[int, int, int]
_SONAR_Z_M = 0.1
_MOUNTS = {
    "left": (SIDE_SONAR_X_M, SIDE_SONAR_Y_M, math.pi / 2),
    "front": (FRONT_SONAR_X_M, 0.0, 0.0),
    "right": (SIDE_SONAR_X_M, -SIDE_SONAR_Y_M, -math.pi / 2),
}
_SLICES = 10
_NEAR, _FAR, _SILENT = (230, 60, 40), (60, 170, 80), (150, 150, 150)
_FAR_M = 2.5
"""An echo from here on is far."""
_STALE_S = 0.3
"""An older reading counts as silent."""
_BELIEF: Colour = (20, 120, 255)
_GUESS: Colour = (150, 190, 255)
_WALL_LENGTH_M = 2.0
_POINTS_M = 0.05
"""Points of the path are so far apart."""
_PALE = 170
"""Grey of the path of an earlier drive."""
_PIECE = 60
"""So many points of the path are sent at a time."""


class Fans:
    """The three ultrasonics of a car: a fan as long as the range, coloured by the echo."""

    def __init__(self, scene: viser.SceneApi, parent: str) -> None:
        """Draw beside the car whose frame is `parent`."""
        half = math.radians(UltrasonicConfig().beam_deg) / 2
        angles = np.linspace(-half, half, _SLICES + 1)
        rim = np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)])
        vertices = np.vstack([np.zeros(3), rim])
        faces = np.array([[0, k + 1, k + 2] for k in range(_SLICES)])
        self._fans = {}
        for side, (x, y, yaw) in _MOUNTS.items():
            self._fans[side] = scene.add_mesh_simple(
                f"{parent}/fan_{side}",
                vertices,
                faces,
                color=_SILENT,
                opacity=0.3,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
                wxyz=(math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)),
                position=(x, y, _SONAR_Z_M),
            )
        self._told: dict[str, tuple[float, Colour]] = {}

    def show(self, readings: Mapping[str, float]) -> None:
        """Show ranges."""
        for side, fan in self._fans.items():
            metres, age = readings.get(f"ultrasonic_{side}", NO_ECHO_M), readings.get(f"ultrasonic_{side}_age", 0.0)
            told = echo(metres, age)
            if told != self._told.get(side):
                self._told[side] = told
                fan.scale, fan.color = told


def echo(metres: float, age_s: float) -> tuple[float, Colour]:
    """Length, m, and colour of a fan: red near, green far, grey where no echo came or the reading is old."""
    silent = metres >= NO_ECHO_M or age_s > _STALE_S
    share = min(metres / _FAR_M, 1.0)
    red, green, blue = (round(near + share * (far - near)) for near, far in zip(_NEAR, _FAR, strict=True))
    return max(min(metres, 5.0), 0.02), _SILENT if silent else (red, green, blue)


class Path:
    """The way of a car so far, in the colours of the states that drove it."""

    def __init__(self, scene: viser.SceneApi, name: str) -> None:
        """Nothing driven yet."""
        self._scene, self._name = scene, name
        self._pieces: list[Any] = []
        self._before: list[Any] = []
        """Path of the drive before."""
        self._count = 0
        self._points: list[tuple[float, float, Colour]] = []

    def show(self, pose: Pose, colour: Colour) -> None:
        """Go on to a pose."""
        x, y, _ = pose
        if self._points and math.hypot(x - self._points[-1][0], y - self._points[-1][1]) < _POINTS_M:
            return
        self._points.append((x, y, colour))
        if len(self._points) < 2:
            return
        if len(self._points) > _PIECE or not self._pieces:
            self._points = self._points[-2:]
            name, self._count = f"{self._name}/{self._count}", self._count + 1
            self._pieces.append(self._scene.add_line_segments(name, *self._segments(), thickness=0.02))
        else:
            piece = self._pieces[-1]
            piece.points, piece.colors = self._segments()

    def _segments(self) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        points = np.array([(x, y, 0.01) for x, y, _ in self._points], np.float32)
        colours = np.array([colour for _, _, colour in self._points[1:]], np.uint8)
        return np.stack([points[:-1], points[1:]], axis=1), np.repeat(colours[:, None], 2, axis=1)

    def fade(self) -> None:
        """Begin anew; the path so far stays as a pale one, and the one before it goes."""
        for piece in self._before:
            piece.remove()
        self._before, self._pieces, self._points = self._pieces, [], []
        for piece in self._before:
            piece.colors = np.full_like(piece.colors, _PALE)

    def clear(self) -> None:
        """Begin anew, without any path."""
        for piece in (*self._before, *self._pieces):
            piece.remove()
        self._before, self._pieces, self._points = [], [], []


class Belief:
    """Where the machine believes that its car, the walls and the gate are."""

    def __init__(self, scene: viser.SceneApi, name: str) -> None:
        """Nothing believed yet."""
        nothing = np.zeros((1, 2, 3), np.float32)
        self._lines = scene.add_line_segments(name, nothing, _BELIEF, thickness=0.02, visible=False)

    def show(self, car: CarFrame, start: Pose | None) -> None:
        """Show an estimate; the frame of dead reckoning began at `start`."""
        estimate = car.estimate
        if estimate is None or start is None or estimate.tick == 0:
            self._lines.visible = False
        else:
            self._lines.visible = True
            lines = list(believed(estimate, start))
            self._lines.points = np.array([points for points, _ in lines], np.float32)
            self._lines.colors = np.array([[colour] * 2 for _, colour in lines], np.uint8)

    def remove(self) -> None:
        """Take it out of the scene."""
        self._lines.remove()


Segment = tuple[tuple[tuple[float, float, float], tuple[float, float, float]], Colour]


def believed(estimate: CarEstimate, start: Pose) -> Iterator[Segment]:
    """Line segments of what an estimate says, in the course's frame: the car's outline, both walls, the gate.

    Args:
        estimate: in the frame of dead reckoning.
        start: pose of that frame in the course's.
    """
    car = compose(start, estimate.pose)
    back, front, half = SIDE_SONAR_X_M - LENGTH_M / 2, SIDE_SONAR_X_M + LENGTH_M / 2, WIDTH_M / 2
    corners = [to_outer(car, x, y) for x, y in ((back, -half), (front, -half), (front, half), (back, half))]
    for one, other in zip(corners, [*corners[1:], corners[0]], strict=True):
        yield _flat(one, other, 0.19, _BELIEF)
    along = start[2] + estimate.along
    middle = to_outer(car, SIDE_SONAR_X_M, 0.0)
    for sign, metres in zip((1.0, -1.0), estimate.clearances(), strict=True):
        if not math.isnan(metres):
            frame = (*middle, along)
            y = sign * (metres + SIDE_SONAR_Y_M)
            ends = to_outer(frame, -_WALL_LENGTH_M / 2, y), to_outer(frame, _WALL_LENGTH_M / 2, y)
            for z in (0.1, 0.3, 0.5):
                yield _flat(*ends, z, _BELIEF)
    yield from _gate(estimate.gate, start, _BELIEF)
    if estimate.guessed_gate.id != estimate.gate.id:
        yield from _gate(estimate.guessed_gate, start, _GUESS)


def _gate(gate: Detection, start: Pose, colour: Colour) -> Iterator[Segment]:
    """Posts of a gate and a bar above, with its axis on the floor; nothing where none was seen."""
    if gate.id < 0:
        return
    frame = compose(start, (gate.x, gate.y, gate.heading))
    half = 0.4 if math.isnan(gate.opening) else gate.opening / 2
    half += MARKER_BOARD_WIDTH_M / 2
    left, right = to_outer(frame, 0.0, half), to_outer(frame, 0.0, -half)
    yield ((*left, 0.0), (*left, 0.6)), colour
    yield ((*right, 0.0), (*right, 0.6)), colour
    yield _flat(left, right, 0.6, colour)
    yield _flat(to_outer(frame, -0.8, 0.0), to_outer(frame, 0.4, 0.0), 0.02, colour)


def _flat(one: tuple[float, float], other: tuple[float, float], z: float, colour: Colour) -> Segment:
    return ((*one, z), (*other, z)), colour
