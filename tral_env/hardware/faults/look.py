"""What the laws are told in each tick."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Look(NamedTuple):
    """What is known of the car after a tick."""

    time_s: float
    """On a clock that never goes back."""
    readings: Mapping[str, float]
    """By the names of `tral_env.interface`; one that is not there has not come yet."""
    throttle: float
    """As applied since the look before."""
    image_s: float | None = None
    """Time of the newest image on the same clock; None: no camera."""
    changed_s: float | None = None
    """Time of the newest image that differed from the one before it."""
    retries: int = 0
    """Transactions with the board that were tried again until now."""
    late_ticks: int = 0
    """Ticks that came late until now."""
    ticks: int = 0
    """All ticks until now."""
