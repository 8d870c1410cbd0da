"""Where dead reckoning puts the car, and by how much it may be wrong: what the filters of gates and of walls share."""

from __future__ import annotations

from typing import NamedTuple

from tral_fsm.control.laws import FULL_LOCK, WHEELBASE

BEND_PER_STEERING = FULL_LOCK / WHEELBASE
"""Curvature that a unit of steering gives around straight ahead, 1/m."""
TRIM_DEVIATION = 0.08
"""Of the trim before anything is known, as a share of full lock: 1.8 degrees. Source: choice, between the levels of
randomization."""
_TRIM_WALK = 0.01
"""How far the trim may wander in a metre."""
_HEADING_WALK = 0.01
"""How far dead reckoning's heading wanders in a metre of straight driving, rad."""
LOCK_DEVIATION = 0.08
"""Of the lock's scale before anything is known. Source: choice, between the levels of randomization."""
_BEND_FAULT = 0.03
"""Share of a turn that dead reckoning may be wrong by, whatever the lock: slip, the linkage's shape."""
_TICK_FAULT_M = 1e-3
"""Hall ticks that are missed or counted twice while the car turns: their share by the way of one, m. Source: 3 % of
ticks of 26 mm, between the levels of randomization."""
_LATE_FAULT = 0.7
"""Share of what it turns while the wheels are under way: latency, the servo's speed."""
_SWEPT_FAULT = 0.02
"""The trim may be other after the wheels have moved: friction stops them elsewhere. For a unit of steering."""


def learn(covariance: list[list[float]], with_measured: list[float], spread: float) -> None:
    """Kalman's step for the covariance of unknowns, after one number was measured.

    Args:
        covariance: (5, 5), changed in place.
        with_measured: (5,) covariance of each unknown with that number.
        spread: variance of that number, its noise included.
    """
    for row, with_it in zip(covariance, with_measured, strict=True):
        gain = with_it / spread
        for j, other in enumerate(with_measured):
            row[j] -= gain * other


class Stand(NamedTuple):
    """Where the car was when a sensor looked, and how it came there; all by dead reckoning."""

    x: float
    """m."""
    y: float
    """m."""
    yaw: float
    """rad."""
    path: float = 0.0
    """Driven so far, less where it reversed, m."""
    turned: float = 0.0
    """By its wheels, rad."""
    wound: float = 0.0
    """Square of the curvature, added up over the way, rad^2/m."""
    late: float = 0.0
    """Turned so far while the wheels were under way, rad."""
    swept: float = 0.0
    """How far the wheels have been moved so far, in units of steering."""

    def heading_wander(self, before: Stand) -> float:
        """Variance of the heading [rad^2] that driving here from a stand before has added, trim and lock aside."""
        return (
            _HEADING_WALK**2 * abs(self.path - before.path)
            + (_BEND_FAULT * (self.turned - before.turned)) ** 2
            + _TICK_FAULT_M * (self.wound - before.wound)
            + (_LATE_FAULT * (self.late - before.late)) ** 2
        )

    def trim_wander(self, before: Stand) -> float:
        """Variance that it has added to the trim."""
        return _TRIM_WALK**2 * abs(self.path - before.path) + (_SWEPT_FAULT * (self.swept - before.swept)) ** 2
