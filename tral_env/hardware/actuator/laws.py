"""From a command to pulses and registers: pure functions of plain numbers, each law once.

The numbers of a channel come from a calibration, see `tral_env.hardware.pulses`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

STEPS = 4096
"""The PWM board divides a period into so many steps."""
MAX_SLEW_S = 0.025
"""A command changes by at most the slew of this time, two control periods: silence earns no jump."""


class Channel(NamedTuple):
    """One pulse output: where it leaves the board, its pulses at command -1, 0 and +1, and its limits."""

    output: int
    minus_us: float
    centre_us: float
    plus_us: float
    skip_us: float
    """The map leaves out so much beside the centre: the dead zone."""
    min_us: float
    max_us: float
    dead_zone_us: float
    """The motor rests this near to the centre."""
    slew_per_s: float | None = None
    """Largest change of the command in one second; None: no limit."""


def clamped(value: float, low: float, high: float) -> float:
    """The value nearest to a finite one within bounds."""
    return min(max(value, low), high)


def pulse_us(command: float, channel: Channel) -> float:
    """Pulse that carries out a command, exact at -1, 0 and +1.

    A command u > 0 has the pulse ``s + u (plus - s)`` with ``s = centre + sign(plus - centre) skip``; u < 0 has minus
    in place of plus, and 0 has the centre.

    Args:
        command: in [-1, 1].
        channel: the channel.

    Returns:
        us, within the channel's limits.
    """
    end = channel.plus_us if command > 0 else channel.minus_us
    skip = 0.0 if command == 0 else math.copysign(channel.skip_us, end - channel.centre_us)
    start = channel.centre_us + skip
    return clamped(start + abs(command) * (end - start), channel.min_us, channel.max_us)


def command_of(us: float, channel: Channel) -> float:
    """Command that a pulse carries out: the inverse of `pulse_us`.

    Args:
        us: pulse, us; one beyond an end counts as that end.
        channel: the channel.

    Returns:
        In [-1, 1]; 0 for a pulse within the skipped dead zone.
    """
    positive = (us - channel.centre_us) * (channel.plus_us - channel.centre_us) > 0.0
    end = channel.plus_us if positive else channel.minus_us
    start = channel.centre_us + math.copysign(channel.skip_us, end - channel.centre_us)
    share = clamped((us - start) / (end - start), 0.0, 1.0)
    return share if positive else 0.0 - share


def slewed(wanted: float, last: float, rate_per_s: float | None, seconds: float, *, zero_at_once: bool) -> float:
    """Command that comes as near to the wanted one as a slew limit allows.

    Args:
        wanted: wanted command.
        last: command before.
        rate_per_s: largest change in one second; None: no limit.
        seconds: time between the two, s.
        zero_at_once: whether 0 is always allowed, as it must be for a throttle.
    """
    if rate_per_s is None:
        return wanted
    step = rate_per_s * seconds
    low, high = last - step, last + step
    if zero_at_once:
        low, high = min(low, 0.0), max(high, 0.0)
    return clamped(wanted, low, high)


def prescale(oscillator_hz: float, period_us: float) -> int:
    """Divider of the board for a period: round(oscillator period / 4096) - 1. Source: data sheet, 7.3.5."""
    return round(oscillator_hz * period_us * 1e-6 / STEPS) - 1


def step_us(divider: int, oscillator_hz: float) -> float:
    """The board makes pulses in steps of this length, us: (prescale + 1) / oscillator."""
    return (divider + 1) / oscillator_hz * 1e6


def board_steps(us: float, channel: Channel, step: float) -> int:
    """Steps of a pulse, rounded, though never beyond a limit of its channel."""
    return int(clamped(round(us / step), math.ceil(channel.min_us / step), math.floor(channel.max_us / step)))
