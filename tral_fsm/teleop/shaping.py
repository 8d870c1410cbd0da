"""From the hand to a command: dead zone, expo, and the dead man's button. Pure laws, each once."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from tral_env.checks import check_number
from tral_env.errors import ConfigError
from tral_env.se2 import clip
from tral_fsm.teleop.hands import Hands


@dataclass(frozen=True, kw_only=True)
class Shaping:
    """How the hand becomes a command."""

    dead_zone: float = 0.1
    """A stick this near to its middle is in the middle. Source: sticks of XBOX pads rest within 0.08."""
    expo: float = 0.4
    """Share of the cubic in the curve of the steering: 0 is a straight line; more is finer near the middle. Source:
    choice."""
    max_throttle: float = 0.35
    """Throttle at the end of the trigger: 0.66 m/s. Source: choice."""

    def __post_init__(self) -> None:
        """Check the values."""
        for each in fields(self):
            value = getattr(self, each.name)
            check_number(f"shaping: {each.name}", value)
            if not 0.0 <= value <= _UPPER_ENDS[each.name]:
                raise ConfigError(f"shaping: {each.name} = {value!r}, expected 0 to {_UPPER_ENDS[each.name]:g}")


_UPPER_ENDS = {"dead_zone": 0.9, "expo": 1.0, "max_throttle": 1.0}


def without_dead_zone(value: float, zone: float) -> float:
    """0 within the zone, then a straight line to the ends at -1 and 1: ``sign(v) (|v| - z) / (1 - z)``."""
    return math.copysign(max(abs(clip(value)) - zone, 0.0) / (1.0 - zone), value)


def with_expo(value: float, share: float) -> float:
    """``(1 - e) v + e v^3``: finer near the middle, the same at the ends."""
    return (1.0 - share) * value + share * value**3


class DeadMan:
    """Lets a throttle through while the button is held, if it was at rest since the button was last not held.

    So a trigger that is held down when the button is pressed makes no car jump. It may be at rest before the button is
    pressed: a key that is held is trigger and button in one.
    """

    def __init__(self) -> None:
        self._rested = False

    def throttle(self, hands: Hands, wanted: float) -> float:
        """The throttle that passes."""
        self._rested = wanted == 0.0 or (hands.holds and self._rested)
        return wanted if self._rested else 0.0


def command(hands: Hands, shaping: Shaping, dead_man: DeadMan) -> tuple[float, float]:
    """Steering and throttle of a car that a person drives; straight on in neutral while the button is not held."""
    wanted = shaping.max_throttle * without_dead_zone(hands.throttle, shaping.dead_zone)
    throttle = dead_man.throttle(hands, wanted)
    steering = with_expo(without_dead_zone(hands.steering, shaping.dead_zone), shaping.expo)
    return (steering, throttle) if hands.holds else (0.0, 0.0)
