"""Contenders that need no file: two floors that see nothing, and a ceiling that knows the truth."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env import task
from tral_env.interface import CONTROL_RATE_HZ
from tral_env.se2 import rotate_back
from tral_env.speed_control import SpeedRegulator
from tral_env.world import World
from tral_fsm.control.laws import pursuit
from tral_fsm.evaluation.episode import NO_WISH, EpisodeRequest
from tral_fsm.evaluation.loop import Index, Pair
from tral_fsm.evaluation.row_policies import RowPolicies, Unwatched

Array = NDArray[np.float64]

CONSTANT_COMMAND = (0.0, 0.25)
"""Steering and throttle of the contender `constant`: straight on, at about 0.4 m/s. Source: choice."""
RANDOM_HOLD_TICKS = 8
"""The contender `random` holds each command so long: ten commands a second. Source: choice."""
LOOK_AHEAD_M = 0.5
"""The pursuit aims at the route so far ahead. Source: choice; twice the wheelbase."""
BEND_AHEAD_M = 1.2
"""The pursuit slows down for bends so far ahead. Source: choice; a bend's speed is reached in half of it."""
MAX_ROUTE_SPEED_MPS = 1.5
"""Speed of the pursuit on a straight. Source: measured; it arrives on all of 20 hard courses of five families."""
SIDE_MPS2 = 1.0
"""The pursuit's acceleration to the side in a bend is at most this, m/s^2. Source: as above; a fifth of the grip of the
most slippery floor."""
MIN_ROUTE_SPEED_MPS = 0.4
"""The pursuit drives no bend slower than this. Source: choice."""


class Constant(Unwatched):
    """Drives straight on, whatever it reads."""

    def __init__(self, world: World) -> None:
        """Need nothing of the cars."""

    def assign(self, row: int, request: EpisodeRequest) -> None:
        """Do nothing: it has no memory."""

    def release(self, row: int) -> None:
        """Do nothing."""

    def act(self, rows: Index, observation: NDArray[np.floating]) -> tuple[Sequence[Any], Sequence[Pair]]:
        """The same command for each row."""
        return [CONSTANT_COMMAND] * len(rows), [NO_WISH] * len(rows)


class Random(Unwatched):
    """Draws commands uniformly from the whole action space; a request always gets the same ones."""

    def __init__(self, world: World) -> None:
        """Need the number of the cars alone."""
        self._rngs = [np.random.default_rng(0)] * world.n
        self._tick = np.zeros(world.n, np.int64)
        self._command = np.zeros((world.n, 2))

    def assign(self, row: int, request: EpisodeRequest) -> None:
        """Begin the commands of a request."""
        self._rngs[row] = np.random.default_rng([request.seed, zlib.crc32(request.scenario.encode())])
        self._tick[row] = 0

    def release(self, row: int) -> None:
        """Do nothing."""

    def act(self, rows: Index, observation: NDArray[np.floating]) -> tuple[Sequence[Any], Sequence[Pair]]:
        """Command of each row, drawn anew every `RANDOM_HOLD_TICKS`."""
        for row in rows[self._tick[rows] % RANDOM_HOLD_TICKS == 0].tolist():
            self._command[row] = self._rngs[row].uniform(-1.0, 1.0, 2)
        self._tick[rows] += 1
        return list(self._command[rows]), [NO_WISH] * len(rows)


class TruePursuit(Unwatched):
    """Pure pursuit with ground truth: it knows its true pose and speed, and the route.

    No policy may know these. It shows what the car and the courses allow.
    """

    def __init__(self, world: World) -> None:
        """Look at the cars."""
        self._world = world
        self._segment = np.zeros(world.n, np.int64)
        self._regulators = [SpeedRegulator() for _ in range(world.n)]

    def assign(self, row: int, request: EpisodeRequest) -> None:
        """Begin at the start of the route."""
        self._segment[row], self._regulators[row] = 0, SpeedRegulator()

    def release(self, row: int) -> None:
        """Do nothing."""

    def act(self, rows: Index, observation: NDArray[np.floating]) -> tuple[Sequence[Any], Sequence[Pair]]:
        """Commands towards the route ahead, with the speed that its bends allow."""
        world, track = self._world, self._world.track
        pose = world.sim.pose[rows]
        s, _, self._segment[rows] = task.locate(track, rows, pose[:, :2], self._segment[rows])
        aim, _ = along_route(track, rows, s + LOOK_AHEAD_M)
        cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
        x, y = rotate_back(cos, sin, aim[:, 0] - pose[:, 0], aim[:, 1] - pose[:, 1])
        wanted, speed = bend_speed(track, rows, s), world.sim.truth.speed[rows]
        commands = []
        for k, row in enumerate(rows.tolist()):
            throttle = self._regulators[row].regulate(float(wanted[k]), float(speed[k]))
            commands.append((pursuit(float(x[k]), float(y[k])), throttle))
        return commands, [NO_WISH] * len(rows)


def along_route(track: task.Track, rows: Index, s: Array) -> tuple[Array, Array]:
    """Points (k, 2) [m] and unit vectors (k, 2) of the routes at arc lengths s (k,) [m]; straight on beyond the end."""
    at = np.minimum((track.route_s[rows] <= s[:, None]).sum(axis=1) - 1, track.last[rows] - 1)
    at = np.maximum(at, 0)
    unit: Array = track.route_unit[rows, at]
    point: Array = track.route[rows, at] + unit * (s - track.route_s[rows, at])[:, None]
    return point, unit


def bend_speed(track: task.Track, rows: Index, s: Array) -> Array:
    """Speed (k,) [m/s] at arc lengths s (k,) [m]: v^2 = a / curvature of the route ahead, within its limits."""
    turn = np.zeros(len(rows))
    step = BEND_AHEAD_M / 4.0
    units = [along_route(track, rows, s + k * step)[1] for k in range(5)]
    for one, following in pairwise(units):
        cosine = np.clip((one * following).sum(axis=1), -1.0, 1.0)
        turn = np.maximum(turn, np.arccos(cosine) / step)
    return np.clip(np.sqrt(SIDE_MPS2 / np.maximum(turn, 1e-6)), MIN_ROUTE_SPEED_MPS, MAX_ROUTE_SPEED_MPS)


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """A contender that needs no file."""

    meaning: str
    make: Callable[[World], RowPolicies]
    sees_truth: bool = False
    decision_hz: float = CONTROL_RATE_HZ


BASELINES: Mapping[str, Baseline] = {
    "constant": Baseline(meaning="straight on at constant throttle; it reads nothing", make=Constant),
    "random": Baseline(
        meaning="uniformly random commands, ten a second; it reads nothing",
        make=Random,
        decision_hz=CONTROL_RATE_HZ / RANDOM_HOLD_TICKS,
    ),
    "pursuit": Baseline(
        meaning="pure pursuit with ground truth: it knows its pose, its speed and the route",
        make=TruePursuit,
        sees_truth=True,
    ),
}
"""The built-in contenders by name."""
