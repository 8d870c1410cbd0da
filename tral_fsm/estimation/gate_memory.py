"""The gates that a car has seen: each where it was, the nearest one, and one of which only a marker is in view."""

from __future__ import annotations

import math
from collections.abc import Callable

from tral_env.interface import GATE_MARKER_IDS
from tral_env.se2 import wrap
from tral_fsm.estimation.detections import NOTHING, Detection
from tral_fsm.estimation.gate_tracker import GateTracker
from tral_fsm.estimation.odometry import OdometrySample

_HALF_GATE_M = 0.5
"""A marker stands so far beside the middle of its gate, m. Source: choice, the family `gates` has 0.4 to 0.7."""
_MAX_POST_ANGLE = math.radians(45.0)
"""Gates are not guessed from markers that are seen more from the side than this. Source: choice."""
_OPENING_GAIN = 0.2
"""Share of an image's word on the width of a gate that is believed. Source: choice."""


class GateMemory:
    """Gates in the frame of dead reckoning."""

    __slots__ = ("_trackers", "guess", "nearest", "target")

    def __init__(self) -> None:
        self._trackers: dict[int, GateTracker] = {}
        self.nearest = NOTHING
        """The nearest gate of the last image that showed one whole, corrected by all that was seen of it."""
        self.guess = NOTHING
        """The gate of a marker that is seen alone: where it was when both were seen, or else its middle is guessed."""
        self.target = NOTHING
        """The gate that a state was handed last: where it was seen last, though another one be in view."""

    def was_seen(self, gate: int) -> bool:
        """Whether both markers of a gate were ever seen at once."""
        return gate in self._trackers

    def grow_older(self) -> None:
        """A tick without a new image has passed."""
        nearest, target = self.nearest, self.target
        self.nearest, self.guess = nearest.older(), self.guess.older()
        self.target = self.nearest if target is nearest else target.older()

    def follow(self) -> None:
        """Keep the target where it was seen last, and know how old that is; asked after a new image was seen."""
        target = self.target
        if target.id < 0:
            return
        self.target = target.older()
        for seen in (self.nearest, self.guess):
            if seen.new and seen.id == target.id:
                self.target = seen

    def beside(self, x: float, y: float) -> bool:
        """Whether a car at x, y [m] may hear the posts of a gate."""
        for tracker in self._trackers.values():  # noqa: SIM110 - any(...) would cost a generator at each range
            if tracker.beside(x, y):
                return True
        return False

    def correct(self, seen: Detection, sample: OdometrySample, trim_sigma: float) -> tuple[float, float]:
        """Let a new detection of the nearest gate correct what earlier ones told of it.

        Args:
            seen: where it was seen.
            sample: where the car was when the image was exposed.
            trim_sigma: how well the trim is known, for a gate that is new.

        Returns:
            What to add to the trim and to the steering gain.
        """
        tracker = self._trackers.get(seen.id)
        if tracker is None:
            self._trackers[seen.id] = GateTracker(seen.x, seen.y, seen.heading, sample, trim_sigma)
            self.nearest = seen
            return 0.0, 0.0
        correction = tracker.update(seen.x, seen.y, seen.heading, sample)
        self.nearest = _recalled(seen, tracker)
        return correction

    def measure_opening(self, opening: float) -> None:
        """Take the opening [m] of the nearest gate in a new image."""
        tracker = self._trackers[self.nearest.id]
        known = tracker.opening
        tracker.opening = opening if math.isnan(known) else known + _OPENING_GAIN * (opening - known)
        self.nearest = self.nearest._replace(opening=tracker.opening)

    def guess_from(self, marker: Detection, yaw: float, behind_wall: Callable[[float, float], bool]) -> bool:
        """Guess from a marker where the gate is whose other marker is out of view; a car's yaw [rad] tells its side.

        Args:
            marker: the nearest one in view.
            yaw: of the car, rad.
            behind_wall: whether a place x, y [m] lies behind a wall, where no gate is.

        Returns:
            Whether there is a new guess of a gate that was never seen whole.
        """
        is_post = (
            marker.new
            and marker.id in GATE_MARKER_IDS
            and marker.id // 2 != self.nearest.id
            and abs(wrap(marker.heading - yaw)) < _MAX_POST_ANGLE
        )
        if not is_post:
            if self.guess.id >= 0:
                self.guess = self.guess.older()
            return False
        gate, is_right = divmod(marker.id, 2)
        guess = Detection(gate, age=marker.age, new=True, support=marker.support)
        tracker = self._trackers.get(gate)
        if tracker is not None:
            self.guess = _recalled(guess, tracker)
            return False
        left = _HALF_GATE_M if is_right else -_HALF_GATE_M
        x = marker.x - left * math.sin(marker.heading)
        y = marker.y + left * math.cos(marker.heading)
        if behind_wall(x, y):
            self.guess = self.guess.older()
            return False
        self.guess = guess.placed(x, y, marker.heading)
        return True


def _recalled(seen: Detection, tracker: GateTracker) -> Detection:
    """A detection at the place where its gate is known to be."""
    return seen.placed(tracker.x, tracker.y, tracker.heading, tracker.opening)
