"""The gates that a car has seen: each where it was, the nearest one, and one of which only a marker is in view."""

from __future__ import annotations

import math

from tral_env.interface import CONTROL_PERIOD_S, GATE_MARKER_IDS, MAX_AGE_S
from tral_fsm.control.laws import wrap
from tral_fsm.estimation.gate_tracker import Track
from tral_fsm.estimation.odometry import Stand
from tral_fsm.estimation.sonar import Sighting

_HALF_GATE_M = 0.5
"""A marker stands so far beside the middle of its gate, m. Source: choice, the family `gates` has 0.4 to 0.7."""
_POST_ANGLE = math.radians(45.0)
"""Gates are not guessed from markers that are seen more from the side than this. Source: choice."""
_OPENING_GAIN = 0.2
"""Share of an image's word on the width of a gate that is believed. Source: choice."""


class Gates:
    """Gates in the frame of dead reckoning."""

    __slots__ = ("_tracks", "guess", "nearest", "target")

    def __init__(self) -> None:
        self._tracks: dict[int, Track] = {}
        self.nearest = Sighting()
        """The nearest gate of the last image that showed one whole, corrected by all that was seen of it."""
        self.guess = Sighting()
        """The gate of a marker that is seen alone: where it was when both were seen, or else its middle is guessed."""
        self.target = Sighting()
        """The gate that a state was handed last: where it was seen last, though another one be in view."""

    def was_seen(self, gate: int) -> bool:
        """Whether both markers of a gate were ever seen at once."""
        return gate in self._tracks

    def aim(self, gate: Sighting) -> None:
        """Take a gate as the target."""
        target = self.target
        target.id, target.age, target.opening = gate.id, gate.age, gate.opening
        target.x, target.y, target.heading = gate.x, gate.y, gate.heading

    def follow(self) -> None:
        """Keep the target where it was seen last, and know how old that is; asked in each tick, after all was seen."""
        target = self.target
        target.age = min(target.age + CONTROL_PERIOD_S, MAX_AGE_S)
        for seen in (self.nearest, self.guess):
            if seen.new and seen.id == target.id:
                self.aim(seen)

    def beside(self, x: float, y: float) -> bool:
        """Whether a car at x, y [m] may hear the posts of a gate."""
        return any(track.beside(x, y) for track in self._tracks.values())

    def correct(self, stand: Stand, trim_deviation: float) -> tuple[float, float]:
        """Let a new sighting of the nearest gate correct what earlier ones told of it.

        Args:
            stand: where the car was when the image was exposed.
            trim_deviation: how well the trim is known, for a gate that is new.

        Returns:
            What to add to the trim and to the scale of the lock.
        """
        gate = self.nearest
        track = self._tracks.get(gate.id)
        if track is None:
            self._tracks[gate.id] = Track(gate.x, gate.y, gate.heading, stand, trim_deviation)
            gate.opening = math.nan
            return 0.0, 0.0
        faults = track.take(gate.x, gate.y, gate.heading, stand)
        recall(gate, track)
        return faults

    def measure(self, opening: float) -> None:
        """Take the opening [m] of the nearest gate in a new image."""
        track = self._tracks[self.nearest.id]
        known = track.opening
        track.opening = known + _OPENING_GAIN * (opening - known) if known == known else opening
        self.nearest.opening = track.opening

    def look(self, marker: Sighting, yaw: float) -> bool:
        """Guess from a marker where the gate is whose other marker is out of view; a car's yaw [rad] tells its side.

        Returns:
            Whether there is a new guess of a gate that was never seen whole.
        """
        guess = self.guess
        guess.age = min(guess.age + CONTROL_PERIOD_S, MAX_AGE_S)
        guess.new = (
            marker.new
            and marker.id in GATE_MARKER_IDS
            and marker.id // 2 != self.nearest.id
            and abs(wrap(marker.heading - yaw)) < _POST_ANGLE
        )
        if not guess.new:
            return False
        guess.id, is_right = divmod(marker.id, 2)
        guess.age, guess.opening = marker.age, math.nan
        track = self._tracks.get(guess.id)
        if track is not None:
            recall(guess, track)
            return False
        left = _HALF_GATE_M if is_right else -_HALF_GATE_M
        guess.x = marker.x - left * math.sin(marker.heading)
        guess.y = marker.y + left * math.cos(marker.heading)
        guess.heading = marker.heading
        return True


def recall(seen: Sighting, track: Track) -> None:
    """Put a sighting where its gate is known to be."""
    seen.x, seen.y, seen.heading, seen.opening = track.x, track.y, track.heading, track.opening
