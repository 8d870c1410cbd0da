"""How a learner meets the car: what it sees of the readings, how often it decides, and what its decision means.

Training, environments, policy files and the real car share this code, so that a policy sees everywhere what it saw when
it learned. Every array has the cars along its first axis; n is the number of cars.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Flags
from tral_env.checks import is_number
from tral_env.errors import ConfigError, nearest
from tral_env.interface import (
    CONTROL_PERIOD_S,
    CONTROL_RATE_HZ,
    CORE_LAYOUT,
    NO_ECHO_M,
    STEERING,
    THROTTLE,
    TURN_MARKER_IDS,
    Layout,
)
from tral_env.speed_control import SpeedRegulator

Values = NDArray[np.float32]

OBSERVATIONS = ("readings", "features")
ACTIONS = ("throttle", "speed")
MIN_DECISION_HZ = 1.0
"""A car does not drive longer than 1 s on one decision. Source: choice."""
MAX_FRAMES = 4096
"""A view keeps so many frames of a car at most, 0.5 MB."""
MAX_HISTORY = 256
"""An observation holds so many frames at most."""
MAX_SPEED_MPS = 5.0
"""Fastest speed that an action can ask for: as fast as the hall sensor reads."""

_RANGE_M = NO_ECHO_M / 2
"""A range of this is 0, one of twice as much 1."""
_RANGE_AGE_S = 0.2
"""A range of this age or more has the age 1; the slowest sonar answers every 0.11 s."""
_SPEED_MPS = 2.0
"""This speed is 1."""
_AHEAD_M = 5.0
"""A gate or sign so far ahead is at 1."""
_ASIDE_M = 2.0
"""A gate or sign so far to the left is at 1."""
MEMORY_S = 5.0
"""A gate or sign counts as seen for so long; the car may meanwhile have turned away from it."""

RANGES = ("left", "front", "right")
DETECTIONS = ("gate", "marker")


def pair(value: Any) -> Any:
    """A list, as JSON has it, as a tuple; all else as it is."""
    return tuple(value) if isinstance(value, list) else value


@dataclass(frozen=True, kw_only=True)
class LearnerConfig:
    """How a learner meets the car. The environments take each field as an option."""

    decision_hz: float = CONTROL_RATE_HZ
    """Decisions a second: each takes a whole number of ticks of 1/80 s, in which the command is held and rewards add
    up. A step of the environment is a decision."""
    observation: str = "readings"
    """`"readings"`: what the car measures, in SI units. `"features"`: the same, made ready for a network, see
    `tral_env.learner.LearnerView`."""
    history: int = 1
    """Number of frames in an observation, the oldest first. At a reset all of them are the first one."""
    spacing_s: float | None = None
    """Time between two frames, a whole number of ticks, s. `None`: that between two decisions."""
    action: str = "throttle"
    """What the second action is: `"throttle"`, or `"speed"`, which is regulated on the hall sensor as the machines'
    speed is."""
    drive_range: tuple[float, float] | None = field(default=None, metadata={"read": pair})
    """What -1 and 1 of the second action stand for: throttles, or speeds in m/s. `None`: -1 and 1, or 0 and 1.2 m/s."""
    detections: bool = True
    """Whether features tell gates and turn signs. A network is smaller without them."""

    def __post_init__(self) -> None:
        for name, allowed in (("observation", OBSERVATIONS), ("action", ACTIONS)):
            if getattr(self, name) not in allowed:
                raise ConfigError(f"unknown {name} '{getattr(self, name)}': {nearest(getattr(self, name), allowed)}")
        if not is_number(self.decision_hz) or not MIN_DECISION_HZ <= self.decision_hz <= CONTROL_RATE_HZ:
            raise ConfigError(
                f"decision_hz = {self.decision_hz!r}: expected at least {MIN_DECISION_HZ:g}, at most {_rate(1)}"
            )
        if _whole(CONTROL_RATE_HZ / self.decision_hz) is None:
            ticks = CONTROL_RATE_HZ / self.decision_hz
            raise ConfigError(
                f"decision_hz = {self.decision_hz:g}: a decision would take {ticks:g} ticks of 1/80 s, which is no "
                f"whole number: expected {_rate(math.floor(ticks))} or {_rate(math.ceil(ticks))}"
            )
        if not is_number(self.history, whole=True) or not 1 <= self.history <= MAX_HISTORY:
            raise ConfigError(f"history = {self.history!r}: expected a whole number, 1 to {MAX_HISTORY}")
        self._check_spacing()
        if self.kept_frames > MAX_FRAMES:
            raise ConfigError(
                f"history = {self.history} with spacing_s = {self.spacing_s}: {self.kept_frames} frames of a car would "
                f"be kept, expected {MAX_FRAMES} at most: choose a shorter history or a spacing of whole decisions"
            )
        self._check_drive_range()
        if not isinstance(self.detections, bool):
            raise ConfigError(f"detections = {self.detections!r}: expected True or False")

    def _check_spacing(self) -> None:
        if self.spacing_s is None:
            return
        if not is_number(self.spacing_s) or not CONTROL_PERIOD_S <= self.spacing_s <= 10.0:
            raise ConfigError(f"spacing_s = {self.spacing_s!r}: expected {CONTROL_PERIOD_S:g} to 10 s, or None")
        if _whole(self.spacing_s * CONTROL_RATE_HZ) is None:
            ticks = self.spacing_s * CONTROL_RATE_HZ
            low, high = (round(whole * CONTROL_PERIOD_S, 6) for whole in (math.floor(ticks), math.ceil(ticks)))
            raise ConfigError(
                f"spacing_s = {self.spacing_s:g}: it would be {ticks:g} ticks of 1/80 s, which is no whole number: "
                f"expected {low:g} or {high:g} s"
            )

    def _check_drive_range(self) -> None:
        if self.drive_range is None:
            return
        given, lowest, highest = self.drive_range, *((0.0, MAX_SPEED_MPS) if self.action == "speed" else (-1.0, 1.0))
        is_pair = isinstance(given, tuple) and len(given) == 2 and all(map(is_number, given))
        if not is_pair or not lowest <= given[0] < given[1] <= highest:
            raise ConfigError(
                f"drive_range = {given!r} with action='{self.action}': expected two numbers that rise, from {lowest:g} "
                f"to {highest:g}, or None"
            )

    @property
    def decision_ticks(self) -> int:
        """Ticks for which a decision is held."""
        return round(CONTROL_RATE_HZ / self.decision_hz)

    @property
    def spacing_ticks(self) -> int:
        """Ticks between two frames."""
        return self.decision_ticks if self.spacing_s is None else round(self.spacing_s * CONTROL_RATE_HZ)

    @property
    def interval_ticks(self) -> int:
        """Ticks between two frames that are kept: the most that meet both the decisions and the frames of a history."""
        return math.gcd(self.decision_ticks, self.spacing_ticks)

    @property
    def kept_frames(self) -> int:
        """Frames of a car that are kept."""
        return (self.history - 1) * (self.spacing_ticks // self.interval_ticks) + 1

    @property
    def drives_from_to(self) -> tuple[float, float]:
        """What -1 and 1 of the second action stand for, throttles or m/s."""
        return self.drive_range or ((0.0, 1.2) if self.action == "speed" else (-1.0, 1.0))

    def record(self) -> dict[str, Any]:
        """The fields, for JSON."""
        values = {place.name: getattr(self, place.name) for place in fields(LearnerConfig)}
        values = {name: value.item() if isinstance(value, np.generic) else value for name, value in values.items()}
        return values | {"drive_range": None if self.drive_range is None else list(self.drive_range)}

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> LearnerConfig:
        """The configuration of a record.

        Raises:
            ConfigError: it has a name that is none, or a value is not allowed.
        """
        names = [place.name for place in fields(LearnerConfig)]
        for name in values:
            if name not in names:
                raise ConfigError(f"a learner has no '{name}': {nearest(name, names)}")
        return LearnerConfig(**{**values, "drive_range": pair(values.get("drive_range"))})


def _whole(value: float) -> int | None:
    """The whole number that a quotient stands for; None: it is none."""
    return round(value) if abs(value - round(value)) < 1e-6 else None


def _rate(ticks: int) -> str:
    return f"{CONTROL_RATE_HZ / ticks:.9g}"


def feature_names(detections: bool = True) -> tuple[str, ...]:
    """Names of the features of one frame, in order.

    Args:
        detections: whether gates and turn signs are among them.
    """
    ranges = [f"{side}_{what}" for what in ("range", "age", "echo") for side in RANGES]
    names = [*ranges, "speed", "steering", "throttle", "way"]
    if detections:
        names += [f"{kind}_{what}" for what in ("x", "y", "age", "sin", "cos", "seen") for kind in ("gate", "sign")]
        names += [f"sign_{turn}" for turn in TURN_MARKER_IDS]
    return tuple(names)


class _Features:
    """Makes frames of features out of readings."""

    def __init__(self, layout: Layout, config: LearnerConfig) -> None:
        column = layout.column
        self.names = feature_names(config.detections)
        self._detections = config.detections
        scaled: list[tuple[str, float, float]] = [
            *((f"ultrasonic_{side}", -1.0, 1 / _RANGE_M) for side in RANGES),
            *((f"ultrasonic_{side}_age", 0.0, 1 / _RANGE_AGE_S) for side in RANGES),
            ("speed", 0.0, 1 / _SPEED_MPS),
            ("steering", 0.0, 1.0),
            ("throttle", 0.0, 1.0),
        ]
        if config.detections:
            for what, factor in (("x", 1 / _AHEAD_M), ("y", 1 / _ASIDE_M), ("age", 1 / MEMORY_S)):
                scaled += [(f"{kind}_{what}", 0.0, factor) for kind in DETECTIONS]
        self._columns = np.array([column(name) for name, _, _ in scaled])
        self._offset = np.array([offset for _, offset, _ in scaled], np.float32)
        self._factor = np.array([factor for _, _, factor in scaled], np.float32)
        self._ranges = np.array([column(f"ultrasonic_{side}") for side in RANGES])
        self._headings = np.array([column(f"{kind}_heading") for kind in DETECTIONS])
        self._ids = np.array([column(f"{kind}_id") for kind in DETECTIONS])
        self._turns = np.array([*TURN_MARKER_IDS.values()], np.float32)
        self._way_factor = np.float32(1 / (_SPEED_MPS * config.spacing_ticks * CONTROL_PERIOD_S))

    def frames(self, readings: Values, way: Values) -> Values:
        """(k, F) features of readings (k, d) and of the way (k,) since the last frame, m."""
        out = np.empty((len(readings), len(self.names)), np.float32)
        scaled = readings[:, self._columns] * self._factor + self._offset
        np.minimum(np.maximum(scaled, -1.0, out=scaled), 1.0, out=scaled)
        out[:, 0:6] = scaled[:, 0:6]
        out[:, 6:9] = readings[:, self._ranges] < NO_ECHO_M
        out[:, 9:12] = scaled[:, 6:9]
        out[:, 12] = np.minimum(way * self._way_factor, 1.0)
        if self._detections:
            self._tell_detections(out, readings, scaled[:, 9:])
        return out

    def _tell_detections(self, out: Values, readings: Values, scaled: Values) -> None:
        """Fill the features of gates and signs: 0 but for the age where nothing was seen lately."""
        ids = readings[:, self._ids]
        turns = ids[:, 1:] == self._turns
        seen = scaled[:, 4:6] < 1.0
        seen[:, 0] &= ids[:, 0] >= 0.0
        seen[:, 1] &= turns.any(axis=1)
        heading = readings[:, self._headings]
        out[:, 13:15] = scaled[:, 0:2] * seen
        out[:, 15:17] = scaled[:, 2:4] * seen
        out[:, 17:19] = np.where(seen, scaled[:, 4:6], 1.0)
        out[:, 19:21] = np.sin(heading) * seen
        out[:, 21:23] = np.cos(heading) * seen
        out[:, 23:25] = seen
        out[:, 25:28] = turns & seen[:, 1:]


class LearnerView:
    """What learners see of n cars: `history` frames, the oldest first, the newest of now.

    A frame is the readings, or these features of the core readings, all in [-1, 1]:

    | feature | what it is |
    | --- | --- |
    | `left_range`, `front_range`, `right_range` | range / 3 m - 1; 1: no echo |
    | `left_age`, ... | age of the range / 0.2 s, at most 1 |
    | `left_echo`, ... | 1: there was an echo, 0: none |
    | `speed` | speed / 2 m/s |
    | `steering`, `throttle` | the last command, as applied |
    | `way` | way since the frame before / way at 2 m/s, at most 1 |
    | `gate_x`, `sign_x` | forward distance of the gate or turn sign / 5 m |
    | `gate_y`, `sign_y` | its distance to the left / 2 m |
    | `gate_age`, `sign_age` | age of the detection / 5 s; 1: nothing seen for so long |
    | `gate_sin`, `gate_cos`, ... | sine and cosine of its heading |
    | `gate_seen`, `sign_seen` | 1: seen in the last 5 s; else the features above but the age are 0 |
    | `sign_left`, `sign_right`, `sign_straight` | 1: the sign tells this turn |
    """

    def __init__(self, config: LearnerConfig, n: int, layout: Layout = CORE_LAYOUT) -> None:
        """Make the view; `reset` must come first for each car.

        Args:
            config: what is seen.
            n: number of cars.
            layout: columns of the readings.
        """
        self.config, self.n = config, n
        self._features = _Features(layout, config) if config.observation == "features" else None
        self.frame_names = layout.names if self._features is None else self._features.names
        """(F,) names of the columns of a frame."""
        self._distance = layout.column("distance")
        self._interval = config.interval_ticks
        self._stride = config.spacing_ticks // self._interval
        self._frames = np.zeros((n, config.kept_frames, len(self.frame_names)), np.float32)
        self._way = np.zeros((n, self._stride), np.float64)
        """(n, stride) distance counted at the frames kept last, m."""
        self._tick = np.zeros(n, np.int64)
        """(n,) ticks since reset."""
        self._common: int | None = None
        """The same as a number where it is that of all cars: this saves half the time of a single car."""

    @property
    def size(self) -> int:
        """Length of an observation: frames times columns."""
        return self.config.history * len(self.frame_names)

    @property
    def due(self) -> Flags:
        """(n,) a decision is due."""
        if self._common is not None:
            return np.full(self.n, self._common % self.config.decision_ticks == 0)
        is_due: Flags = self._tick % self.config.decision_ticks == 0
        return is_due

    def reset(self, rows: Flags, readings: NDArray[np.floating]) -> None:
        """Begin episodes: every frame is the first one.

        Args:
            rows: (n,) which cars.
            readings: (n, d), in the columns of the layout.
        """
        self._tick[rows] = 0
        self._common = 0 if rows.all() else None
        distance = readings[rows, self._distance]
        self._way[rows] = distance[:, None]
        self._frames[rows] = self._frame(np.asarray(readings[rows], np.float32), np.zeros_like(distance))[:, None]

    def update(self, readings: NDArray[np.floating], rows: Flags | None = None, ended: Flags | None = None) -> None:
        """Take over what was read after a tick.

        Args:
            readings: (n, d).
            rows: (n,) the cars that moved; None: all.
            ended: (n,) cars whose episode ended in this tick: they keep a frame at once, since no other will come.
        """
        if rows is None and self._common is not None:
            self._tick += 1
            self._common += 1
            if self._common % self._interval == 0:
                self._keep_all(readings)
            elif ended is not None and ended.any():
                self._keep(ended, readings)
            return
        self._common = None
        moved = True if rows is None else rows
        self._tick += moved
        keep = moved & (self._tick % self._interval == 0)
        keep = keep if ended is None else keep | ended
        if keep.any():
            self._keep(keep, readings)

    def _keep_all(self, readings: NDArray[np.floating]) -> None:
        """Keep a frame of each car, and forget the oldest."""
        now = np.asarray(readings, np.float32)
        distance = now[:, self._distance].astype(np.float64)
        way = (distance - self._way[:, 0]).astype(np.float32)
        self._way[:, :-1] = self._way[:, 1:]
        self._way[:, -1] = distance
        self._frames[:, :-1] = self._frames[:, 1:]
        self._frames[:, -1] = self._frame(now, way)

    def _keep(self, rows: Flags, readings: NDArray[np.floating]) -> None:
        """Keep a frame of some cars, and forget the oldest."""
        now = np.asarray(readings[rows], np.float32)
        distance = now[:, self._distance].astype(np.float64)
        way = (distance - self._way[rows, 0]).astype(np.float32)
        self._way[rows] = np.concatenate([self._way[rows, 1:], distance[:, None]], axis=1)
        self._frames[rows] = np.concatenate([self._frames[rows, 1:], self._frame(now, way)[:, None]], axis=1)

    def _frame(self, readings: Values, way: Values) -> Values:
        return readings if self._features is None else self._features.frames(readings, way)

    def observation(self) -> Values:
        """What the learners see now, (n, H * F)."""
        return self._frames[:, :: self._stride].reshape(self.n, -1).copy()


class Actuation:
    """Turns the actions of learners into the commands of n cars, tick by tick."""

    def __init__(self, config: LearnerConfig, n: int) -> None:
        self._is_speed = config.action == "speed"
        self._is_plain = not self._is_speed and config.drive_range is None
        self._low, high = config.drives_from_to
        self._half = (high - self._low) / 2
        self._regulators = [SpeedRegulator() for _ in range(n)] if self._is_speed else []

    def reset(self, rows: Flags) -> None:
        """Forget what was regulated in some cars (n,)."""
        if self._is_speed:
            for row in np.flatnonzero(rows):
                self._regulators[row] = SpeedRegulator()

    def wanted(self, actions: NDArray[np.floating]) -> NDArray[np.float64]:
        """What actions (n, 2) mean: (n, 2) steering, and throttle or speed in m/s. One beyond 1 counts as 1."""
        wanted = np.asarray(actions, np.float64)
        if self._is_plain:
            return wanted
        wanted = np.minimum(np.maximum(wanted, -1.0), 1.0)
        wanted[:, THROTTLE] = _rounded(self._low + (wanted[:, THROTTLE] + 1.0) * self._half)
        return wanted

    def command(
        self, wanted: NDArray[np.float64], speed: NDArray[np.floating], rows: Flags | None = None
    ) -> NDArray[np.float64]:
        """Command of one tick.

        Args:
            wanted: (n, 2) of `wanted`.
            speed: (n,) from the hall sensor, m/s.
            rows: (n,) the cars that drive; None: all.

        Returns:
            (n, 2) steering, throttle.
        """
        if not self._is_speed:
            return wanted
        command = wanted.copy()
        driving = range(len(wanted)) if rows is None else np.flatnonzero(rows).tolist()
        speeds, now = wanted[:, THROTTLE].tolist(), speed.tolist()
        for row in driving:
            command[row, THROTTLE] = self._regulators[row].regulate(speeds[row], now[row])
        command[:, THROTTLE] = _rounded(command[:, THROTTLE])
        return command


def _rounded(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values as float32 has them, as policies answer: so environments drive the same bit for bit."""
    return values.astype(np.float32).astype(np.float64)


def inverse(config: LearnerConfig, steering: NDArray[np.floating], drive: NDArray[np.floating]) -> Values:
    """The actions (n, 2) that mean this steering (n,) and this throttle or speed (n,), as far as the range allows."""
    low, high = config.drives_from_to
    actions = np.empty((len(steering), 2), np.float32)
    actions[:, STEERING] = steering
    actions[:, THROTTLE] = (drive - low) * (2 / (high - low)) - 1.0
    np.minimum(np.maximum(actions, -1.0, out=actions), 1.0, out=actions)
    return actions


def corrected(
    command: NDArray[np.floating], correction: NDArray[np.floating], bounds: tuple[float, float]
) -> NDArray[np.float32]:
    """Commands (n, 2) of a policy with corrections (n, 2) in [-1, 1], each times its bound, within [-1, 1]."""
    step = np.clip(correction, -1.0, 1.0).astype(np.float64) * np.array(bounds)
    total: NDArray[np.float64] = command.astype(np.float64) + step
    return np.clip(total, -1.0, 1.0).astype(np.float32)
