"""Gates and markers as the camera saw them, in the frame of dead reckoning."""

from __future__ import annotations

import math
from typing import NamedTuple

from tral_env.geometry import WIDTH_M
from tral_env.interface import MAX_AGE_S

MIN_ROOM_M = 0.03
"""However narrow a gate is, no way ends more exactly, m. Source: choice."""


class Detection(NamedTuple):
    """A gate or marker that was seen, so that it can be found again when it is out of view."""

    id: int = -1
    """-1: none yet."""
    x: float = 0.0
    """m, in the frame of dead reckoning."""
    y: float = 0.0
    """m."""
    heading: float = 0.0
    """Direction in which the car passes a gate, or drives into a marker's face, rad."""
    age: float = MAX_AGE_S
    """s since the image was exposed."""
    new: bool = False
    """This tick brought a new image of it."""
    opening: float = math.nan
    """Of a gate, between its boards, m; NaN: not known yet."""

    def aged(self, age: float) -> Detection:
        """The same in a tick that brought no new image, at an age [s]."""
        return Detection(self.id, self.x, self.y, self.heading, age, False, self.opening)

    def placed(self, x: float, y: float, heading: float, opening: float = math.nan) -> Detection:
        """The same at another place."""
        return Detection(self.id, x, y, heading, self.age, self.new, opening)

    def room(self, margin: float) -> float:
        """How far beside the middle of the gate a car may pass with a margin [m] on either side, m; NaN: not known."""
        half = self.opening / 2.0
        return math.nan if math.isnan(half) else max(half - WIDTH_M / 2.0 - margin, MIN_ROOM_M)


NOTHING = Detection()
