"""The laws: each is fed with a look in each tick, and says what is wrong; no text: nothing is."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple, Protocol

from tral_env.geometry import FRONT_SONAR_FROM_MIDDLE_M, LENGTH_M
from tral_env.hardware.faults.limits import FaultLimits
from tral_env.hardware.faults.look import Look
from tral_env.interface import NO_ECHO_M
from tral_env.speed_control import SPEED_PER_THROTTLE, THROTTLE_DEAD

SIDES = ("left", "front", "right")
_RESPONSE_S = 0.3
"""Time in which the car reaches 63 % of the speed that a throttle stands for, s. Source: docs/car.md."""
_RANGING_S = 0.06
"""An ultrasonic needs at least so long for a ranging, s: a board that tells its range more often repeats it."""
_SAME_S = 0.001
"""Two times of arrival that are nearer are one, s."""
_WHOLE_CM = 1e-5
"""A range this near to whole centimetres, m, comes from an ultrasonic that measures in centimetres."""
_MAX_STEP_S = 0.1
"""A look after a longer pause counts as one after this time, s: nobody drove in the pause."""
_BUMPER_M = LENGTH_M / 2 - FRONT_SONAR_FROM_MIDDLE_M
"""The bumper is so far ahead of the front ultrasonic, m."""
_KNOWN_TICKS = 80
"""A second of ticks has to be known before a share of them is judged."""
STOPPING = (
    (0.0, 0.0), (0.26, 0.05), (0.52, 0.13), (1.05, 0.34), (1.58, 0.58), (1.98, 0.78), (2.38, 1.01),
)  # fmt: skip
"""Speeds, m/s, and the way that the car still goes when the actuator's process stops it by full brake, m: 0.4 s of
brake, then no pulses, with 20 ms of latency. Source: the model of docs/car.md, by
`tests/car/test_stopping.py`."""
ROLLING = (
    (0.0, 0.0), (0.26, 0.11), (0.52, 0.35), (1.05, 1.01), (1.58, 1.78), (1.98, 2.40), (2.38, 3.03),
)  # fmt: skip
"""The same where it stops the car by neutral, m. Source: as above."""


class Law(Protocol):
    """One law."""

    def update(self, look: Look) -> str:
        """What is wrong, with numbers; empty: nothing is."""
        ...


class Watched(NamedTuple):
    """A law at work."""

    fault: str
    """Name of the fault that it notices."""
    law: Law


def laws_for(provided: frozenset[str], limits: FaultLimits, brake: float) -> Iterator[Watched]:
    """The laws for a car that measures these readings and is stopped with this throttle."""
    if {"distance", "speed"} <= provided:
        yield Watched("no motion", NoMotion(limits))
    for side in SIDES:
        if f"ultrasonic_{side}_age" in provided:
            yield Watched("sonar silent", SonarSilent(limits, side))
            yield Watched("sonar frozen", SonarFrozen(limits, side))
    yield Watched("camera stale", CameraStale(limits))
    if "speed" in provided:
        yield Watched("camera frozen", CameraFrozen(limits))
    if "battery" in provided:
        yield Watched("battery empty", Battery(limits.battery_empty_v, limits.battery_s))
        yield Watched("battery low", Battery(limits.battery_low_v, limits.battery_s))
    if {"ultrasonic_front", "ultrasonic_front_age", "speed"} <= provided:
        yield Watched("too near", TooNear(limits, brake))
    yield Watched("bus errors", BusErrors(limits))
    yield Watched("loop late", LoopLate(limits))


class _Steps:
    """Time from look to look, s."""

    def __init__(self) -> None:
        self._last_s: float | None = None

    def __call__(self, now_s: float) -> float:
        step_s = 0.0 if self._last_s is None else min(now_s - self._last_s, _MAX_STEP_S)
        self._last_s = now_s
        return step_s


class NoMotion:
    """Told to drive forward, and the hall sensor counts nothing, for too long or for too long a way.

    The way is that of the car's model at this throttle. It is what a car whose hall sensor is dead really drives.
    Pauses do not count, so that the neutral in which a stalled car tries again does not hide it.
    """

    def __init__(self, limits: FaultLimits) -> None:
        self._limits, self._steps = limits, _Steps()
        self._told_s = self._blind_m = self._model_mps = 0.0
        self._distance = 0.0

    def update(self, look: Look) -> str:
        """See `Law.update`."""
        limits, step_s = self._limits, self._steps(look.time_s)
        wanted_mps = SPEED_PER_THROTTLE * max(look.throttle - THROTTLE_DEAD, 0.0)
        self._model_mps += (wanted_mps - self._model_mps) * -math.expm1(-step_s / _RESPONSE_S)
        self._blind_m += self._model_mps * step_s
        self._told_s += step_s * (look.throttle > limits.driving_throttle)
        distance = look.readings.get("distance", 0.0)
        if distance != self._distance:
            self._distance, self._told_s, self._blind_m = distance, 0.0, 0.0
        elif look.readings.get("speed", 0.0) >= limits.moving_mps:
            self._told_s = 0.0
        if self._told_s > _or_never(limits.standstill_s):
            return f"told to drive for {self._told_s:.1f} s without motion"
        if self._blind_m > _or_never(limits.blind_m):
            return f"throttle for {self._blind_m:.1f} m without one tick of the hall sensor"
        return ""


class SonarSilent:
    """An ultrasonic whose range is too old; one that never gave any gets as long for its first."""

    def __init__(self, limits: FaultLimits, side: str) -> None:
        self._limit_s, self._side = _or_never(limits.silent_s), side
        self._begun_s: float | None = None

    def update(self, look: Look) -> str:
        """See `Law.update`."""
        self._begun_s = look.time_s if self._begun_s is None else self._begun_s
        watched_s = look.time_s - self._begun_s
        silent_s = min(look.readings.get(f"ultrasonic_{self._side}_age", math.inf), watched_s)
        return f"{self._side}, for {silent_s:.1f} s" if silent_s > self._limit_s else ""


class _Echoes:
    """Notices each new echo of an ultrasonic."""

    def __init__(self, side: str) -> None:
        self._name, self._came_s, self._range_m = f"ultrasonic_{side}", -math.inf, math.nan

    def new(self, look: Look) -> float | None:
        """The range of an echo that came since the look before, m.

        It is known by its time of arrival, because echoes that come in each tick all have the age 0. The same range
        again within one ranging is the same echo, told twice.
        """
        age_s, range_m = look.readings.get(f"{self._name}_age", math.inf), look.readings.get(self._name)
        passed_s = look.time_s - age_s - self._came_s
        if range_m is None or not passed_s > (_RANGING_S if range_m == self._range_m else _SAME_S):
            return None
        self._came_s, self._range_m = look.time_s - age_s, range_m
        return range_m


class SonarFrozen:
    """The same range, to the last digit, in echo after echo while the car moves on; no echo at all does not count."""

    def __init__(self, limits: FaultLimits, side: str) -> None:
        self._limits, self._least = limits, limits.frozen_echoes
        self._side, self._echoes = side, _Echoes(side)
        self._range_m, self._count, self._since_m = math.nan, 0, 0.0

    def update(self, look: Look) -> str:
        """See `Law.update`."""
        echo_m, distance = self._echoes.new(look), look.readings.get("distance", 0.0)
        if echo_m is not None and echo_m != self._range_m:
            self._range_m, self._count, self._since_m = echo_m, 0, distance
        self._count += echo_m is not None
        moved_m = distance - self._since_m
        is_coarse = abs(self._range_m - round(self._range_m, 2)) < _WHOLE_CM
        limit_m = _or_never(self._limits.frozen_cm_m if is_coarse else self._limits.frozen_m)
        if self._range_m < NO_ECHO_M and self._count >= self._least and moved_m > limit_m:
            return f"{self._side}, {self._range_m:.2f} m in {self._count} echoes over {moved_m:.1f} m"
        return ""


class CameraStale:
    """The newest image is too old; a camera that never gave any gets as long for its first."""

    def __init__(self, limits: FaultLimits) -> None:
        self._limit_s = _or_never(limits.image_s)
        self._begun_s: float | None = None

    def update(self, look: Look) -> str:
        """See `Law.update`."""
        self._begun_s = look.time_s if self._begun_s is None else self._begun_s
        newest_s = look.time_s if look.image_s is None else max(look.image_s, self._begun_s)
        stale_s = look.time_s - newest_s
        return f"the newest image is {stale_s:.1f} s old" if stale_s > self._limit_s else ""


class CameraFrozen:
    """Images come, and are one and the same to the last bit, while the car moves on."""

    def __init__(self, limits: FaultLimits) -> None:
        self._limit_s, self._moving_mps, self._steps = _or_never(limits.image_s), limits.moving_mps, _Steps()
        self._changed_s: float | None = None
        self._same_s = 0.0

    def update(self, look: Look) -> str:
        """See `Law.update`."""
        step_s = self._steps(look.time_s)
        if look.changed_s != self._changed_s:
            self._changed_s, self._same_s = look.changed_s, 0.0
        elif look.changed_s is not None and look.readings.get("speed", 0.0) >= self._moving_mps:
            self._same_s += step_s
        return f"one image for {self._same_s:.1f} s of driving" if self._same_s > self._limit_s else ""


class Battery:
    """The mean voltage is too low; 0 is no voltage, but a battery that was not measured yet."""

    def __init__(self, limit_v: float | None, mean_s: float) -> None:
        self._limit_v, self._mean_s, self._steps = limit_v or 0.0, mean_s, _Steps()
        self._known_s = self._sum_vs = 0.0

    def update(self, look: Look) -> str:
        """See `Law.update`."""
        step_s, volts = self._steps(look.time_s), look.readings.get("battery", 0.0)
        if volts <= 0.0:
            return ""
        kept = math.exp(-step_s / self._mean_s)
        self._sum_vs = self._sum_vs * kept + volts * step_s
        self._known_s = self._known_s * kept + step_s
        mean_v = self._sum_vs / self._known_s if self._known_s >= self._mean_s / 2 else math.inf
        return f"{mean_v:.1f} V in the mean, below {self._limit_v:g} V" if mean_v < self._limit_v else ""


def stopping_m(speed: float, brake: float = -1.0, rolling_share: float = 1.0) -> float:
    """Way that the car still goes when it is stopped at a speed, m.

    Args:
        speed: of the car, m/s.
        brake: throttle of the stop: -1 is `STOPPING`, 0 is `ROLLING`; between them the car needs less than a straight
            line says.
        rolling_share: share of `ROLLING` that counts.
    """
    return -brake * _between(STOPPING, speed) + (1.0 + brake) * rolling_share * _between(ROLLING, speed)


def _between(table: tuple[tuple[float, float], ...], speed: float) -> float:
    """The way of a table at a speed, with straight lines between, and the last one beyond, m."""
    lines = list(pairwise(table))
    (low, start_m), (high, end_m) = next((line for line in lines if speed <= line[1][0]), lines[-1])
    return start_m + (speed - low) / (high - low) * (end_m - start_m)


class TooNear:
    """Echo after echo from ahead is nearer than the car can stop, from its speed, its latency and the echo's age.

    A car that brakes already is let alone, and so is one that drives backwards.
    """

    def __init__(self, limits: FaultLimits, brake: float) -> None:
        self._limits, self._brake, self._echoes = limits, brake, _Echoes("front")
        self._count = 0

    def update(self, look: Look) -> str:
        """See `Law.update`."""
        echo_m, speed = self._echoes.new(look), look.readings.get("speed", 0.0)
        if self._limits.reaction_s is None or echo_m is None:
            return ""
        passed_s = look.readings["ultrasonic_front_age"] + self._limits.reaction_s
        left_m = echo_m - _BUMPER_M - speed * passed_s
        needed_m = stopping_m(speed, self._brake, self._limits.rolling_share)
        is_near = look.throttle >= 0.0 and speed > 0.0 and left_m < needed_m
        self._count = self._count + 1 if is_near else 0
        if self._count < self._limits.echoes:
            return ""
        return f"{left_m:.2f} m are left at {speed:.2f} m/s, and {needed_m:.2f} m count for a stop"


class _Window:
    """How much a count grew within the last so many seconds."""

    def __init__(self, seconds: float) -> None:
        self._seconds, self._counts = seconds, deque[tuple[float, int]]()

    def grown(self, now_s: float, count: int) -> int:
        """Take a count; how much it grew."""
        if not self._counts or now_s - self._counts[-1][0] >= self._seconds / 100:
            self._counts.append((now_s, count))
        while now_s - self._counts[0][0] > self._seconds:
            self._counts.popleft()
        return count - self._counts[0][1]


class BusErrors:
    """Many transactions with the board had to be tried again."""

    def __init__(self, limits: FaultLimits) -> None:
        self._limit, self._window = _or_never(limits.retries), _Window(limits.window_s)
        self._window_s = limits.window_s

    def update(self, look: Look) -> str:
        """See `Law.update`."""
        again = self._window.grown(look.time_s, look.retries)
        return f"{again} tried again within {self._window_s:g} s" if again > self._limit else ""


class LoopLate:
    """Many ticks came late; a drive that has just begun is not judged."""

    def __init__(self, limits: FaultLimits) -> None:
        self._limit = _or_never(limits.late_share)
        self._late, self._all = _Window(limits.window_s), _Window(limits.window_s)

    def update(self, look: Look) -> str:
        """See `Law.update`."""
        late = self._late.grown(look.time_s, look.late_ticks)
        ticks = self._all.grown(look.time_s, look.ticks)
        share = late / ticks if ticks >= _KNOWN_TICKS else 0.0
        return f"{share:.0%} of the last {ticks} ticks" if share > self._limit else ""


def _or_never(limit: float | None) -> float:
    return math.inf if limit is None else limit
