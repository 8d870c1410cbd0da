"""Gates and markers as the camera saw them, in the frame of dead reckoning."""

from __future__ import annotations

import math
from typing import NamedTuple

from tral_env.geometry import WIDTH_M
from tral_env.interface import CONTROL_PERIOD_S, MAX_AGE_S

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
    support: int = 0
    """Number of images in a row that agree on its place, this one included; nothing has 0."""

    def older(self) -> Detection:
        """The same a tick later, without a new image of it; nothing stays nothing."""
        number, x, y, heading, age, new, opening, support = self
        if age >= MAX_AGE_S and not new:
            return self
        age = min(age + CONTROL_PERIOD_S, MAX_AGE_S)
        # Half the time of Detection(...), up to three times a tick.
        return tuple.__new__(Detection, (number, x, y, heading, age, False, opening, support))

    def placed(self, x: float, y: float, heading: float, opening: float = math.nan) -> Detection:
        """The same at another place."""
        return Detection(self.id, x, y, heading, self.age, self.new, opening, self.support)

    def room(self, margin: float) -> float:
        """How far beside the middle of the gate a car may pass with a margin [m] on either side, m; NaN: not known."""
        half = self.opening / 2.0
        return math.nan if math.isnan(half) else max(half - WIDTH_M / 2.0 - margin, MIN_ROOM_M)


NOTHING = Detection()

MIN_SUPPORT = 2
"""An estimator believes a detection on which so many images agree. Source: choice, the fewest that can agree."""
_MAX_GAP_S = 1.0
"""Images that are farther apart do not agree, s. Source: choice, 15 images at 15 Hz."""
_AGREE_M = 0.2
"""Images agree on a place within this distance and a share of the range, m. Source: choice."""
_AGREE_SHARE = 0.1
"""That share. Source: docs/perception.md, the error of a marker at 6 m in strongly degraded images."""


class Agreement:
    """Counts how many images in a row agree where a gate or marker is, each id by itself.

    An image that does not show an id neither confirms nor contradicts its place.
    """

    __slots__ = ("_last",)

    def __init__(self) -> None:
        self._last: dict[int, tuple[float, Detection]] = {}

    def judge(self, seen: Detection, time: float, range_m: float) -> Detection:
        """Give a new detection its support.

        Args:
            seen: what an image shows, in the frame of dead reckoning.
            time: when the image was exposed, s.
            range_m: from the car to it, m.

        Returns:
            The detection with its support: 1 where it contradicts the image of its id before, or is the first.
        """
        then, last = self._last.get(seen.id, (-math.inf, NOTHING))
        near = math.hypot(seen.x - last.x, seen.y - last.y) <= _AGREE_M + _AGREE_SHARE * range_m
        seen = seen._replace(support=last.support + 1 if near and time - then <= _MAX_GAP_S else 1)
        self._last[seen.id] = time, seen
        return seen
