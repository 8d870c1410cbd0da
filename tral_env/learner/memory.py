"""What learners remember of gates, signs and posts: where each is now, by dead reckoning."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from tral_env.arrays import Flags, is_any, maximum, minimum, plain, where
from tral_env.geometry import STANDING_MPS, TRACK_M, curvature
from tral_env.interface import CONTROL_PERIOD_S, DICTIONARY_SIZE, GATE_MARKER_IDS, MAX_AGE_S, TURN_MARKER_IDS, Layout
from tral_env.learner.config import LearnerConfig
from tral_env.learner.features import AHEAD_M, ASIDE_M, Values

_AGREE_M, _AGREE = 0.3, 0.1
"""Two detections of one id are of one thing where dead reckoning puts them nearer together than this and this share of
the distance. Source: choice."""
_SERVO_LAG_S = 0.06
"""Time constant of the servo, as the machines reckon with. Source: choice."""


class _Kind(NamedTuple):
    """What is remembered."""

    name: str
    read_from: str
    """The detection that may show it, "gate" or "marker"."""
    ids: range


_TURNS = TURN_MARKER_IDS.values()
KINDS = (
    _Kind("gate", "gate", range(DICTIONARY_SIZE)),
    _Kind("sign", "marker", range(min(_TURNS), max(_TURNS) + 1)),
    _Kind("left_post", "marker", GATE_MARKER_IDS[0::2]),
    _Kind("right_post", "marker", GATE_MARKER_IDS[1::2]),
)
_SIGN = 1
"""Its place in `KINDS`."""


class _Pose(NamedTuple):
    """Where the cars are by dead reckoning, in the frame in which they began; values (n,) or a number each."""

    distance: Any
    wheel: Any
    """Steering that the wheels have reached."""
    direction: Any
    """1, or -1 in reverse gear, which the hall sensor does not know."""
    x: Any
    y: Any
    yaw: Any
    bend: Any
    """Curvature of the path, 1/m."""
    cos: Any
    sin: Any


class _Thing(NamedTuple):
    """A gate, sign or post in that frame; values (n,) or a number each."""

    latest_id: Any
    """Of the latest detection, believed or not; -1: none."""
    latest_x: Any
    latest_y: Any
    id: Any
    x: Any
    y: Any
    cos: Any
    """Of its direction, as that of `sin`."""
    sin: Any
    age: Any


_NOTHING = _Thing(-1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, MAX_AGE_S)


def memory_names() -> tuple[str, ...]:
    """Names of what is told, in order."""
    names = [f"{kind.name}_{what}" for kind in KINDS for what in ("x", "y", "age", "sin", "cos", "seen")]
    return (*names, *(f"sign_{turn}" for turn in TURN_MARKER_IDS))


class Memory:
    """The last gate, turn sign and post of each side of n cars, told in the frame of each car as it stands now.

    A detection is believed where the one before it had the same id and was near the same place: a marker that is seen
    where there is none moves nothing. Steering that is out of trim lets places drift until they are seen again.
    """

    names = memory_names()
    """(M,) names of what is told."""

    def __init__(self, layout: Layout, config: LearnerConfig, n: int) -> None:
        """Make the memory; `reset` must come first for each car.

        Args:
            layout: columns of the readings.
            config: what tells how often a frame is kept.
            n: number of cars.
        """
        self._n = n
        column = layout.column
        self._motion = itemgetter(*(column(name) for name in ("distance", "speed", "steering", "throttle")))
        self._detections = [
            itemgetter(*(column(f"{kind.read_from}_{what}") for what in ("id", "x", "y", "heading", "age")))
            for kind in KINDS
        ]
        """Of each kind: picks the detection that may show it out of the columns of the readings."""
        self._interval_s = config.interval_ticks * CONTROL_PERIOD_S
        self._reach = 1.0 - math.exp(-self._interval_s / _SERVO_LAG_S)
        """Share of their lag that the wheels make up for between two frames."""
        self._pose: _Pose
        self._things: list[_Thing]
        self._read: list[Any] = []
        """The readings of the last update: a new detection differs from them."""

    def reset(self, rows: Flags, readings: Values) -> None:
        """Forget all that some cars (n,) have seen; the first time all cars. `readings` (n, d) are those of all."""
        values = self._columns(readings)
        distance, _, steering, _ = self._motion(values)
        zero = 0.0 * distance
        pose = _Pose(distance, steering, zero + 1.0, zero, zero, zero, zero, zero + 1.0, zero)
        things = [_Thing(*(zero + value for value in _NOTHING)) for _ in KINDS]
        self._keep(None if rows.all() else rows, pose, things, [zero + math.nan for _ in values])

    def update(self, readings: Values, rows: Flags | None = None) -> None:
        """Move by the way since the last update, and take over what is seen.

        Args:
            readings: (n, d).
            rows: (n,) the cars that moved; None: all.
        """
        read = self._columns(readings)
        distance, speed, steering, throttle = self._motion(read)
        pose = _moved(self._pose, distance, speed, steering, throttle, self._reach)
        things = [
            self._looked(kind, thing, pose, speed, detection(read), detection(self._read))
            for kind, thing, detection in zip(KINDS, self._things, self._detections, strict=True)
        ]
        self._keep(None if self._n == 1 else rows, pose, things, read)

    def _columns(self, readings: Values) -> list[Any]:
        """The readings by column, (n,) each; numbers of a car alone, with which Python computes much faster."""
        return readings[0].tolist() if self._n == 1 else list(readings.T.astype(np.float64))

    def _keep(self, rows: Flags | None, pose: _Pose, things: list[_Thing], read: list[Any]) -> None:
        """Keep what is known now of some cars (n,), or of all."""
        if rows is not None:
            pose = _Pose(*_either(rows, pose, self._pose))
            things = [_Thing(*_either(rows, new, old)) for new, old in zip(things, self._things, strict=True)]
            read = list(_either(rows, read, self._read))
        self._pose, self._things, self._read = pose, things, read

    def _looked(
        self, kind: _Kind, thing: _Thing, pose: _Pose, speed: Any, detection: Sequence[Any], before: Sequence[Any]
    ) -> _Thing:
        """A thing after a look at a detection (id, x, y, heading, age); `before` is that of the last update."""
        ids, x, y, heading, age = detection
        is_new = (x != before[1]) | (y != before[2])
        is_new = is_new & (ids >= kind.ids.start) & (ids < kind.ids.stop) & (age < MAX_AGE_S)
        is_new = is_new & ((ids - kind.ids.start) % kind.ids.step == 0)
        older = minimum(thing.age + self._interval_s, MAX_AGE_S)
        if not is_any(is_new):
            return _Thing(*thing[:-1], older)
        # Where the car was when the image was exposed: back along the circle that it drives.
        way = pose.direction * speed * age
        yaw = pose.yaw - pose.bend * way
        cos, sin = plain(np.cos(yaw)), plain(np.sin(yaw))
        at_x = pose.x - way * pose.cos + x * cos - y * sin
        at_y = pose.y - way * pose.sin + x * sin + y * cos
        off_x, off_y, tolerance = at_x - thing.latest_x, at_y - thing.latest_y, _AGREE_M + _AGREE * (abs(x) + abs(y))
        agrees = is_new & (ids == thing.latest_id) & (off_x * off_x + off_y * off_y < tolerance * tolerance)
        axis = yaw + heading
        told = ids, at_x, at_y, plain(np.cos(axis)), plain(np.sin(axis)), age
        latest = _either(is_new, told[:3], thing[:3])
        return _Thing(*latest, *_either(agrees, told, (*thing[3:-1], older)))

    def told(self) -> Values:
        """What is told now, (n, M), in [-1, 1]."""
        seen = [_seen_from(self._pose, thing) for thing in self._things]
        told = [value for values in seen for value in values]
        told += [seen[_SIGN][-1] * (self._things[_SIGN].id == turn) for turn in _TURNS]
        if self._n == 1:
            return np.array([told], np.float32)
        return np.stack(told, axis=1).astype(np.float32)


def _either(condition: Any, yes: Sequence[Any], no: Sequence[Any]) -> Sequence[Any]:
    """Values (n,) of `yes` where a condition (n,) holds, and of `no` elsewhere; of a car alone all are numbers."""
    if type(condition) is bool:
        return yes if condition else no
    return [np.where(condition, one, other) for one, other in zip(yes, no, strict=True)]


def _moved(pose: _Pose, distance: Any, speed: Any, steering: Any, throttle: Any, reach: float) -> _Pose:
    """The pose after a way of the rear left wheel, on a circle: step along it, then turn.

        x' = x + s cos(yaw + s k / 2),  y' = y + s sin(yaw + s k / 2),  yaw' = yaw + s k,  s = d / (1 - k T / 2)

    Args:
        pose: the pose before.
        distance: that of the hall sensor now, m.
        speed: m/s.
        steering: as applied.
        throttle: as applied.
        reach: share of the lag that the wheels make up for.
    """
    begins = (speed < STANDING_MPS) & (throttle != 0.0)
    direction = where(begins, where(throttle < 0.0, -1.0, 1.0), pose.direction)
    moved = (steering - pose.wheel) * reach
    wheel = pose.wheel + moved
    bend = curvature(wheel - moved / 2.0, tan=_tan)
    way = direction * (distance - pose.distance) / (1.0 - bend * (TRACK_M / 2.0))
    yaw = pose.yaw + way * bend
    cos, sin = plain(np.cos(yaw)), plain(np.sin(yaw))
    x = pose.x + way * (pose.cos + cos) / 2.0
    y = pose.y + way * (pose.sin + sin) / 2.0
    return _Pose(distance, wheel, direction, x, y, yaw, bend, cos, sin)


def _tan(angle: Any) -> Any:
    return plain(np.tan(angle))


def _seen_from(pose: _Pose, thing: _Thing) -> list[Any]:
    """x, y, age, sine, cosine and seen of a thing, scaled."""
    if not is_any(thing.age < MAX_AGE_S):
        nothing = 0.0 * thing.age
        return [nothing, nothing, nothing + 1.0, nothing, nothing, nothing]
    seen = where(thing.age < MAX_AGE_S, 1.0, 0.0)
    x, y, cos, sin = thing.x - pose.x, thing.y - pose.y, pose.cos, pose.sin
    return [
        seen * maximum(minimum((x * cos + y * sin) * (1 / AHEAD_M), 1.0), -1.0),
        seen * maximum(minimum((y * cos - x * sin) * (1 / ASIDE_M), 1.0), -1.0),
        thing.age * (1 / MAX_AGE_S),
        seen * (thing.sin * cos - thing.cos * sin),
        seen * (thing.cos * cos + thing.sin * sin),
        seen,
    ]
