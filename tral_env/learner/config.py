"""How a learner meets the car: the options of the environments, as they stand in a policy file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from tral_env.checks import is_number
from tral_env.errors import ConfigError, nearest
from tral_env.interface import CONTROL_PERIOD_S, CONTROL_RATE_HZ

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
    growth: float = 1.0
    """Each distance between two frames is so many times the next one nearer to now, 1 to 2: a few frames reach far
    back. `1.0`: all are equal."""
    action: str = "throttle"
    """What the second action is: `"throttle"`, or `"speed"`, which is regulated on the hall sensor as the machines'
    speed is."""
    drive_range: tuple[float, float] | None = field(default=None, metadata={"read": pair})
    """What -1 and 1 of the second action stand for: throttles, or speeds in m/s. `None`: -1 and 1, or 0 and 1.2 m/s. A
    speed below -0.25 m/s is a throttle in reverse, one above it and below 0 is 0."""
    detections: bool = True
    """Whether features tell gates and turn signs. A network is smaller without them."""
    memory: bool = False
    """Whether these come from a memory that reckons with the way of the car: gate, turn sign and the post of each side,
    where each is now, for 10 s and once in an observation. `False`: each frame tells gate and sign where they were
    when seen."""

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
        if not is_number(self.growth) or not 1.0 <= self.growth <= 2.0:
            raise ConfigError(f"growth = {self.growth!r}: expected 1 to 2")
        if self.kept_frames > MAX_FRAMES:
            raise ConfigError(
                f"history = {self.history} with spacing_s = {self.spacing_s} and growth = {self.growth:g}: "
                f"{self.kept_frames} frames of a car would be kept, expected {MAX_FRAMES} at most: choose a shorter "
                "history, a smaller growth, or a spacing of whole decisions"
            )
        self._check_drive_range()
        for name in ("detections", "memory"):
            if not isinstance(getattr(self, name), bool):
                raise ConfigError(f"{name} = {getattr(self, name)!r}: expected True or False")

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
        given, lowest, highest = self.drive_range, *((-1.0, MAX_SPEED_MPS) if self.action == "speed" else (-1.0, 1.0))
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
    def ages(self) -> tuple[int, ...]:
        """How old the frames of an observation are, the oldest first, in numbers of kept frames."""
        stride, ages, age, gap = self.spacing_ticks // self.interval_ticks, [0], 0.0, 1.0
        for _ in range(self.history - 1):
            age += gap
            ages.append(min(round(age), MAX_FRAMES) * stride)
            gap = min(gap * self.growth, float(MAX_FRAMES))
        return tuple(reversed(ages))

    @property
    def kept_frames(self) -> int:
        """Frames of a car that are kept."""
        return self.ages[0] + 1

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
