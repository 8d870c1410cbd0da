"""What one car knows about itself: the pulses of servo and motor controller that mean left, straight, forward.

A calibration is a JSON file. The map from a command to pulses, and its inverse, are pure functions of it.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from tral_env.arrays import Array
from tral_env.errors import ConfigError
from tral_env.hardware.actuator.laws import Channel, command_of, pulse_us, slewed
from tral_env.json_text import whole

_MIN_TRAVEL_US = 50
"""Between command 0 and either end the pulse has to change by at least this much."""
PulseUs = Annotated[int, Field(ge=500, le=2500)]


class Knots(NamedTuple):
    """Pulses of a channel at command -1, 0 and +1, and the width beside the centre that the map skips, us."""

    minus: int
    centre: int
    plus: int
    skip: int


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _whole(cls, value: object) -> object:
        """Take 1500.0 for the whole number 1500."""
        return whole(value)


class ChannelCalibration(_Section):
    """Calibration of one channel: what the servo and the motor controller have in common."""

    channel: int = Field(ge=0, le=15, description="Output of the PWM board.")
    neutral_us: PulseUs = Field(description="Pulse of command 0, us.")
    min_us: PulseUs = Field(description="Hard limit: no shorter pulse is ever sent, us.")
    max_us: PulseUs = Field(description="Hard limit: no longer pulse is ever sent, us.")
    slew_per_s: float | None = Field(default=None, gt=0, description="Largest change of the command in a second.")

    @property
    def knots(self) -> Knots:
        """Pulses between which the map from a command is linear."""
        raise NotImplementedError

    @property
    def law(self) -> Channel:
        """The numbers from which `tral_env.hardware.actuator.laws` makes pulses."""
        minus, centre, plus, skip = (float(us) for us in self.knots)
        return Channel(
            self.channel, minus, centre, plus, skip, self.min_us, self.max_us, self._rests_within_us, self.slew_per_s
        )

    @property
    def _rests_within_us(self) -> float:
        return 0.0

    @model_validator(mode="after")
    def _consistent(self) -> ChannelCalibration:
        minus, centre, plus, skip = self.knots
        problems = []
        if not self.min_us < self.max_us:
            problems.append(f"min_us = {self.min_us} is not below max_us = {self.max_us}")
        for what, pulse in (("-1", minus), ("0", centre), ("+1", plus)):
            if not self.min_us <= pulse <= self.max_us:
                problems.append(
                    f"command {what} is {pulse} us, outside the hard limits {self.min_us} .. {self.max_us} us"
                )
        if (minus - centre) * (plus - centre) >= 0:
            problems.append(f"command 0 is {centre} us, not between command -1 = {minus} us and command +1 = {plus} us")
        elif (least := min(abs(minus - centre), abs(plus - centre)) - skip) < _MIN_TRAVEL_US:
            problems.append(
                f"only {least} us are left between command 0 and an end: {minus} .. {centre} .. {plus} us, dead zone "
                f"{skip} us; expected at least {_MIN_TRAVEL_US} us"
            )
        if problems:
            raise ValueError("\n".join(problems))
        return self


class SteeringCalibration(ChannelCalibration):
    """Calibration of the servo."""

    left_us: PulseUs = Field(description="Pulse of full left, us.")
    right_us: PulseUs = Field(description="Pulse of full right, us.")
    trim_us: int = Field(default=0, ge=-300, le=300, description="Added to neutral, so that command 0 drives straight.")

    @property
    def knots(self) -> Knots:
        """Pulses of right, straight and left, us; nothing is skipped."""
        return Knots(self.right_us, self.neutral_us + self.trim_us, self.left_us, 0)


class ThrottleCalibration(ChannelCalibration):
    """Calibration of the motor controller (ESC)."""

    forward_us: PulseUs = Field(description="Pulse of full forward, us.")
    reverse_us: PulseUs = Field(description="Pulse of full reverse or brake, us.")
    dead_zone_us: int = Field(default=0, ge=0, le=300, description="The motor rests this near to neutral, us.")
    skip_dead_zone: bool = Field(default=False, description="Whether the smallest command already moves the motor.")

    @property
    def knots(self) -> Knots:
        """Pulses of reverse, neutral and forward, us, and the dead zone if it is skipped."""
        return Knots(self.reverse_us, self.neutral_us, self.forward_us, self.dead_zone_us if self.skip_dead_zone else 0)

    @property
    def _rests_within_us(self) -> float:
        return float(self.dead_zone_us)


class CarCalibration(_Section):
    """Calibration of one car: the content of a calibration file."""

    schema_: str | None = Field(default=None, alias="$schema", description="JSON Schema, for editors.")
    version: Literal[1] = Field(description="Version of this format.")
    name: str = Field(min_length=1, description="Which car this is.")
    period_us: int = Field(ge=4000, le=34000, description="Time from pulse to pulse, us.")
    oscillator_hz: float = Field(
        default=25e6, gt=20e6, lt=30e6, description="Clock of the PWM board as measured; boards differ by some percent."
    )
    clock_measured: bool = Field(
        default=False,
        description="Whether oscillator_hz was measured on this board: at 27 MHz instead of 25, neutral drives.",
    )
    steering: SteeringCalibration
    throttle: ThrottleCalibration

    @model_validator(mode="after")
    def _neighbours(self) -> CarCalibration:
        if abs(self.steering.channel - self.throttle.channel) != 1:
            raise ValueError(
                f"steering.channel = {self.steering.channel} and throttle.channel = {self.throttle.channel} are not "
                "neighbours: both pulses are to change in one transaction"
            )
        return self

    @property
    def laws(self) -> tuple[Channel, Channel]:
        """Numbers of steering and throttle, see `ChannelCalibration.law`."""
        return self.steering.law, self.throttle.law

    @property
    def neutral_us(self) -> tuple[float, float]:
        """Pulses of steering straight and throttle neutral, us."""
        return float(self.steering.knots.centre), float(self.throttle.knots.centre)

    @property
    def limits_us(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Shortest and longest pulses, each of (steering, throttle), us."""
        return (self.steering.min_us, self.throttle.min_us), (self.steering.max_us, self.throttle.max_us)

    def limited(self, pulses_us: ArrayLike) -> Array:
        """Bring pulses within the hard limits.

        Args:
            pulses_us: (..., 2) steering, throttle, us.

        Returns:
            (..., 2) us.

        Raises:
            ConfigError: a pulse is not a finite number, or the shape is wrong.
        """
        pulses_us = np.asarray(pulses_us, np.float64)
        if pulses_us.shape[-1:] != (2,) or not np.isfinite(pulses_us).all():
            raise ConfigError(f"refused to send the pulses {pulses_us.tolist()}: expected (..., 2) finite us")
        limited: Array = np.clip(pulses_us, *self.limits_us)
        return limited


def checked(action: ArrayLike) -> Array:
    """Check that a command is finite, and bring it into [-1, 1].

    Args:
        action: (..., 2) steering, throttle.

    Returns:
        (..., 2) in [-1, 1].

    Raises:
        ConfigError: the command has another shape, or is not finite.
    """
    command = np.asarray(action, np.float64)
    if command.shape[-1:] != (2,) or not np.isfinite(command).all():
        raise ConfigError(f"refused the action {action!r}: expected (..., 2) finite numbers: steering, throttle")
    return np.clip(command, -1.0, 1.0)


def pulses(action: ArrayLike, calibration: CarCalibration) -> Array:
    """Pulses that carry out commands, see `tral_env.hardware.actuator.laws.pulse_us`.

    Args:
        action: (..., 2) steering, throttle; brought into [-1, 1].
        calibration: calibration of the car.

    Returns:
        (..., 2) us, within the hard limits.

    Raises:
        ConfigError: the command has another shape, or is not finite.
    """
    command = checked(action)
    steering, throttle = calibration.laws
    rows = [[pulse_us(turn, steering), pulse_us(drive, throttle)] for turn, drive in command.reshape(-1, 2).tolist()]
    return np.array(rows, np.float64).reshape(command.shape)


def action_of(pulses_us: ArrayLike, calibration: CarCalibration) -> Array:
    """Command that pulses carry out: the inverse of `pulses`.

    Args:
        pulses_us: (..., 2) us; a pulse beyond full left, right, forward or reverse counts as that.
        calibration: calibration of the car.

    Returns:
        (..., 2) in [-1, 1]: steering, throttle; 0 for a pulse within the skipped dead zone.

    Raises:
        ConfigError: the pulses have another shape, or are not finite.
    """
    us = calibration.limited(pulses_us)
    steering, throttle = calibration.laws
    rows = [[command_of(turn, steering), command_of(drive, throttle)] for turn, drive in us.reshape(-1, 2).tolist()]
    return np.array(rows, np.float64).reshape(us.shape)


def limit_slew(action: ArrayLike, last: ArrayLike, period_s: float, calibration: CarCalibration) -> Array:
    """Command that comes as near to the wanted one as the slew limits allow; throttle 0 is always allowed.

    Args:
        action: (..., 2) wanted command.
        last: (..., 2) command before.
        period_s: time between the two, s.
        calibration: calibration of the car.

    Returns:
        (..., 2) in [-1, 1].

    Raises:
        ConfigError: a command has another shape, or is not finite.
    """
    wanted, before = np.broadcast_arrays(checked(action), checked(last))
    steering, throttle = calibration.laws
    limited = [
        [
            slewed(turn, turned, steering.slew_per_s, period_s, zero_at_once=False),
            slewed(drive, drove, throttle.slew_per_s, period_s, zero_at_once=True),
        ]
        for (turn, drive), (turned, drove) in zip(
            wanted.reshape(-1, 2).tolist(), before.reshape(-1, 2).tolist(), strict=True
        )
    ]
    return np.array(limited, np.float64).reshape(wanted.shape)
