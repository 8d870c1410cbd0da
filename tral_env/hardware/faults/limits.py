"""The numbers by which faults are noticed, each with its source."""

from __future__ import annotations

from dataclasses import dataclass, fields

from tral_env.checks import check_number
from tral_env.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class FaultLimits:
    """When a fault counts; None switches its law off."""

    standstill_s: float | None = 2.0
    """A car may be told to drive for so long in all without motion, s. Source: crash check of ArduPilot Rover,
    CRASH_CHECK_TIMEOUT."""
    moving_mps: float = 0.08
    """A car that reads less does not move, m/s. Source: ArduPilot Rover, CRASH_CHECK_VEL_MIN."""
    driving_throttle: float = 0.11
    """More throttle than this tells the car to drive: a hundredth above the dead zone of the car's model, below which a
    healthy car stands, too. Source: `tral_env.speed_control.THROTTLE_DEAD`."""
    blind_m: float | None = 0.6
    """A car that should have driven so far, by its throttle, without one tick of the hall sensor is stopped before
    `standstill_s`, m: with a dead wire, a speed controller would go on raising the throttle. Source: measured,
    `benchmarks/false_alarms.py`."""
    silent_s: float | None = 0.5
    """An ultrasonic may be silent for so long, s. Source: `tral_fsm.runtime.watch.MAX_SILENCE_S`."""
    frozen_m: float | None = 2.0
    """An ultrasonic may give the same range for so long a way of the car, m. Source: measured, as above."""
    frozen_cm_m: float | None = 6.0
    """As `frozen_m`, for a range of whole centimetres, m: a car that follows a wall well keeps it for long.
    Source: measured, as above."""
    frozen_echoes: int = 10
    """And for so many echoes, so that a car that outruns its ultrasonics is no fault. Source: choice."""
    image_s: float | None = 0.5
    """The newest image may be so old, s. Source: that of an ultrasonic."""
    battery_empty_v: float | None = 6.0
    """Voltage under load of an empty battery, V. Source: that of a car file."""
    battery_low_v: float | None = 6.6
    """Voltage under load below which to warn, V. Source: that of a car file."""
    battery_s: float = 2.0
    """The voltage is a mean over this time, s: a start pulls it down for an instant. Source: choice."""
    reaction_s: float | None = 0.1
    """From the first echo that is too near to the next pulse, s: an echo that confirms it, a tick, a period of the
    board."""
    rolling_share: float = 0.6
    """Where the car is stopped by neutral, this share of the way that it rolls on counts. With 1 it touches nothing,
    and machines that drive around obstacles are stopped for nothing; with less it may touch, at a lower speed. Source:
    measured, as above."""
    echoes: int = 2
    """So many echoes one after the other have to be too near: a single one may be an outlier. Source: choice."""
    retries: int | None = 10
    """So many transactions tried again within `window_s` are worth a warning: 1 % of those that a second of driving
    takes. An I2C bus of a Raspberry Pi loses one in ten thousand."""
    late_share: float | None = 0.2
    """So large a share of late ticks within `window_s` is worth a warning. Source: choice."""
    window_s: float = 10.0
    """Time over which the two above are counted, s."""

    def __post_init__(self) -> None:
        """Check the values."""
        for each in fields(self):
            value = getattr(self, each.name)
            if value is None and "None" in str(each.type):
                continue
            check_number(f"faults: {each.name}", value)
            if not value > 0:
                raise ConfigError(f"faults: {each.name} = {value!r}, expected a number above 0")
