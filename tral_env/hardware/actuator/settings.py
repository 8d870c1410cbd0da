"""What the worker is told at its start: limits, board, channels; as JSON on its command line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from tral_env.errors import ConfigError
from tral_env.hardware.actuator.laws import Channel
from tral_env.hardware.actuator.options import check_quantities, quantity


@dataclass(frozen=True, kw_only=True)
class Limits:
    """When the worker stops the car, and how far commands may go.

    Beyond the largest value of a time, a fault would go on for longer than a car may drive blind: at 1 m/s, half a
    second is half a metre.
    """

    silence_s: float = quantity(0.1, 0.02, 0.5, "s")
    """Without a new command for this long, the worker goes to neutral, s. Source: eight control periods; ArduPilot
    Rover and the mux of F1TENTH take 0.2 s."""
    off_s: float = quantity(0.5, 0.02, 2.0, "s")
    """After this silence the pulses end and the disarm latches, s; above `silence_s`."""
    max_age_s: float = quantity(0.05, 0.005, 0.5, "s")
    """A command that is older when the worker reads it is refused, s."""
    evidence_s: float | None = quantity(1.0, 0.05, 5.0, "s", optional=True)
    """Time for which the car may be told to drive without any change of its observations, s; None: for ever, which is
    for a car without sensors alone. A speed controller needs about 0.6 s until a standing car passes its first hall
    edge."""
    arming_s: float = quantity(1.0, 0.0, 10.0, "s")
    """Neutral stands for this long before the motor is let go, s: a motor controller wants to see it."""
    brake: float = quantity(0.0, -1.0, 0.0)
    """Throttle of a stop after a fault, in [-1, 0]. 0 is neutral, the one pulse that no motor controller takes for
    "drive". Below 0 brakes, and only while the last pulse that moved the car was forward: after a brake and neutral
    the same pulse would be reverse."""
    max_throttle: float = quantity(1.0, 0.0, 1.0)
    """Largest throttle forward, in [0, 1]."""
    max_reverse: float = quantity(1.0, 0.0, 1.0)
    """Largest throttle backward or brake, in [0, 1]."""
    bus_s: float = quantity(0.05, 0.005, 0.5, "s")
    """The board may refuse pulses for this long, retries included, before the worker gives the drive up, s."""
    check_s: float = quantity(0.2, 0.02, 1.0, "s")
    """The board's settings are read back this often, s."""
    hang_s: float = quantity(0.08, 0.03, 0.5, "s")
    """A worker without a sign of life for this long is killed by its keeper, s."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_quantities(self)
        if not self.silence_s < self.off_s:
            raise ConfigError(f"limits: off_s = {self.off_s!r} is not above silence_s = {self.silence_s!r}")
        if self.max_age_s > self.silence_s:
            raise ConfigError(f"limits: max_age_s = {self.max_age_s!r} is above silence_s = {self.silence_s!r}")


MIN_ADDRESS, MAX_ADDRESS = 0x08, 0x77
"""Addresses of devices on an I2C bus; the others are reserved."""
_MIN_US, _MAX_US = 500.0, 2500.0
_PERIOD_US, _OSCILLATOR_HZ = (4000.0, 34000.0), (20e6, 30e6)
"""Bounds of a calibration, see `tral_env.hardware.pulses`."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """All that the worker is told."""

    driver: str
    """Name of a driver, see `tral_env.hardware.actuator.drivers`."""
    bus: int | str
    """I2C bus by number or path; of the driver "log": path of the file."""
    address: int = 0x40
    """Address of the board, 7 bit."""
    options: Mapping[str, Any] | None = None
    """Options of the driver; None: its own, with this bus and this address where it has such."""
    period_us: float
    oscillator_hz: float
    steering: Channel
    throttle: Channel
    limits: Limits = field(default_factory=Limits)
    in_container: bool = False
    """Whether the process may drive a board from within a container, whose end kills it without a last word."""

    def __post_init__(self) -> None:
        """Check the values."""
        problems = [
            f"{name} = {value!r}, expected {low:g} to {high:g}"
            for name, value, low, high in (
                ("address", self.address, MIN_ADDRESS, MAX_ADDRESS),
                ("period_us", self.period_us, *_PERIOD_US),
                ("oscillator_hz", self.oscillator_hz, *_OSCILLATOR_HZ),
            )
            if not low <= value <= high
        ]
        for name, channel in (("steering", self.steering), ("throttle", self.throttle)):
            problems += [f"{name}: {problem}" for problem in _problems(channel)]
        if abs(self.steering.output - self.throttle.output) != 1:
            problems.append(f"outputs {self.steering.output} and {self.throttle.output} are not neighbours")
        if self.limits.brake < 0.0 and not self.throttle.dead_zone_us > 0.0:
            problems.append(
                "limits: brake is below 0, and the calibration has no throttle.dead_zone_us: nobody knows from which "
                "pulse on the motor controller drives forward, so the brake might be reverse. Measure the dead zone"
            )
        if problems:
            raise ConfigError("settings of the actuator: " + "; ".join(problems))

    def to_json(self) -> str:
        """The settings as text."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Settings:
        """Settings from text."""
        content: dict[str, Any] = json.loads(text)
        steering, throttle = (Channel(*content.pop(name)) for name in ("steering", "throttle"))
        return cls(steering=steering, throttle=throttle, limits=Limits(**content.pop("limits")), **content)


def _problems(channel: Channel) -> list[str]:
    """What is wrong with a channel; each comparison fails for NaN too."""
    minus, centre, plus = channel.minus_us, channel.centre_us, channel.plus_us
    problems = []
    if channel.output not in range(16):
        problems.append(f"output {channel.output}, expected 0 to 15")
    if not _MIN_US <= channel.min_us < channel.max_us <= _MAX_US:
        problems.append(f"limits {channel.min_us:g} to {channel.max_us:g} us, expected within 500 to 2500")
    if not channel.min_us <= min(minus, plus) < centre < max(minus, plus) <= channel.max_us:
        problems.append(f"pulses {minus:g}, {centre:g}, {plus:g} us do not lie one behind the other within the limits")
    if not (0.0 <= channel.skip_us < _MAX_US and 0.0 <= channel.dead_zone_us < _MAX_US):
        problems.append(f"skips {channel.skip_us:g} us, rests within {channel.dead_zone_us:g} us")
    if channel.slew_per_s is not None and not channel.slew_per_s > 0.0:
        problems.append(f"slew {channel.slew_per_s:g} per s, expected above 0")
    return problems
