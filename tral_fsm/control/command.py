"""What a state answers: a command, as plain data."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeGuard

from tral_env.interface import CORE_LAYOUT
from tral_fsm.estimation.detections import Detection

MAX_SPEED_MPS = CORE_LAYOUT.fields[CORE_LAYOUT.column("speed")].high
"""The hall sensor reads no faster speed."""


class Command(NamedTuple):
    """What a state wants in one tick.

    `speed` alone is regulated on the hall sensor. `throttle` alone is the open loop. With both the throttle is applied
    as it is, and the speed says what it is for. With neither the car rolls in neutral.
    """

    steering: float | None = None
    """In [-1, 1], + = left, of a car without faults: the driver adds trim and gain. None: the servo's neutral."""
    speed: float | None = None
    """m/s, 0 to `MAX_SPEED_MPS`; a car that is to reverse gets a throttle."""
    throttle: float | None = None
    """In [-1, 1], + = forward."""
    steering_trim: float | None = None
    """Steering that the car needs to run straight, as far as its machine file says so. None: as before, filled in
    by the driver."""
    wanted_side: float = math.nan
    """Wall that the state keeps a clearance to: +1 left, -1 right, NaN none."""
    wanted_clearance: float = math.nan
    """That clearance, from side ultrasonic to wall, m."""
    target: Detection | None = None
    """A gate that is the target from now on; None: no change. The machine fills it in."""


IDLE = Command()


def is_command(answer: object) -> TypeGuard[Command]:
    """Whether an answer is a command: its numbers are finite, its speed and throttle within their bounds; a wanted
    clearance may be NaN, which is none."""
    if not isinstance(answer, Command):
        return False
    steering, speed, throttle, steering_trim, side, clearance, target = answer
    try:
        if not math.isfinite((steering or 0.0) + (speed or 0.0) + (throttle or 0.0) + (steering_trim or 0.0)):
            return False
        if not 0.0 <= (speed or 0.0) <= MAX_SPEED_MPS or not -1.0 <= (throttle or 0.0) <= 1.0 or speed is True:
            return False
        if math.isinf(side) or math.isinf(clearance):
            return False
        return target is None or math.isfinite(target.x + target.y + target.heading)
    except (AttributeError, TypeError, ValueError):  # texts, arrays, something else than a detection
        return False
