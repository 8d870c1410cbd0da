"""What the worker is told at its start: limits, board, channels; as JSON on its command line."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from tral_env.errors import ConfigError
from tral_env.hardware.actuator.laws import Channel


@dataclass(frozen=True, kw_only=True)
class Limits:
    """When the worker stops the car, and how far commands may go."""

    silence_s: float = 0.1
    """Without a new command for this long, the worker goes to neutral, s. Source: eight control periods; ArduPilot
    Rover and the mux of F1TENTH take 0.2 s."""
    off_s: float = 0.5
    """After this silence the pulses end and the disarm latches, s; above `silence_s`."""
    max_age_s: float = 0.05
    """A command that is older when the worker reads it is refused, s."""
    evidence_s: float | None = 1.0
    """Time for which the car may be told to drive without any change of its observations, s; None: for ever, which is
    for a car without sensors alone. A speed controller needs about 0.6 s until a standing car passes its first hall
    edge."""
    arming_s: float = 1.0
    """Neutral stands for this long before the motor is let go, s: a motor controller wants to see it."""
    brake: float = 0.0
    """Throttle of a stop after a fault, in [-1, 0]. 0 is neutral, the one pulse that no motor controller takes for
    "drive". Below 0 brakes, and only while the last pulse that moved the car was forward: after a brake and neutral
    the same pulse would be reverse."""
    max_throttle: float = 1.0
    """Largest throttle forward, in [0, 1]."""
    max_reverse: float = 1.0
    """Largest throttle backward or brake, in [0, 1]."""
    bus_s: float = 0.05
    """The board may refuse pulses for this long, retries included, before the worker gives the drive up, s."""
    check_s: float = 0.2
    """The board's settings are read back this often, s."""
    hang_s: float = 0.08
    """A worker without a sign of life for this long is killed by its keeper, s."""

    def __post_init__(self) -> None:
        """Check the values."""
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name == "evidence_s" and value is None:
                continue
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise ConfigError(f"limits: {each.name} = {value!r}, expected a finite number")
            low, high = _BOUNDS.get(each.name, (0.001, 60.0))
            if not low <= value <= high:
                raise ConfigError(f"limits: {each.name} = {value!r}, expected {low:g} to {high:g}")
        if not self.silence_s < self.off_s:
            raise ConfigError(f"limits: off_s = {self.off_s!r} is not above silence_s = {self.silence_s!r}")


_BOUNDS = {
    "silence_s": (0.02, 1.0),
    "off_s": (0.02, 5.0),
    "arming_s": (0.0, 10.0),
    "brake": (-1.0, 0.0),
    "max_throttle": (0.0, 1.0),
    "max_reverse": (0.0, 1.0),
    "hang_s": (0.03, 1.0),
}
"""Smallest and largest value of each limit, where they are not 0.001 and 60."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """All that the worker is told."""

    driver: str
    """Name of a driver, see `tral_env.hardware.actuator.drivers`."""
    bus: int | str
    """I2C bus by number or path; of the driver "log": path of the file."""
    address: int = 0x40
    """Address of the board, 7 bit."""
    period_us: float
    oscillator_hz: float
    steering: Channel
    throttle: Channel
    limits: Limits = field(default_factory=Limits)

    def to_json(self) -> str:
        """The settings as text."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Settings:
        """Settings from text."""
        content: dict[str, Any] = json.loads(text)
        steering, throttle = (Channel(*content.pop(name)) for name in ("steering", "throttle"))
        return cls(steering=steering, throttle=throttle, limits=Limits(**content.pop("limits")), **content)
