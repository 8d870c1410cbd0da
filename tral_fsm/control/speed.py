"""From the command of a state to the throttle of its car."""

from __future__ import annotations

from tral_env.speed_control import SpeedRegulator
from tral_fsm.control.command import Command

# A car stands, moves, rolls or can be braked: four questions to the hall sensor, whose slowest reading is 0.1 m/s.
# `tral_env.geometry.STANDING_MPS`, 0.05, is the first: below it the car stands.
MOVING_MPS = 0.08
"""A car that reads less, and counts no way, does not move. Source: ArduPilot Rover, CRASH_CHECK_VEL_MIN."""
ROLLING_MPS = 0.1
"""A faster car counts as rolling, m/s. Source: choice, near the slowest speed that the hall sensor can read."""
BRAKE = 0.3
"""Throttle against the direction of travel with which a car stops. Source: choice."""


class SpeedController(SpeedRegulator):
    """Makes the throttle of a command, for one car."""

    __slots__ = ()

    def throttle(self, command: Command, speed: float) -> float:
        """Throttle of one tick; where the speed is not regulated, what the regulator has summed up is forgotten.

        Args:
            command: what the state wants.
            speed: from the hall sensor, m/s.
        """
        if command.throttle is None and command.speed is not None:
            return self.regulate(command.speed, speed)
        if command.throttle is not None and command.throttle < 0.0 and command.speed is None:
            return self.reverse(command.throttle, speed)
        return self.pass_on(command.throttle or 0.0)


class SingleBrake:
    """A brake that ends once: a motor controller takes the next one for reverse.

    So a late tick of the hall sensor, after the car came to rest, brings no second brake.
    """

    __slots__ = ("_has_braked", "_is_over")

    def __init__(self) -> None:
        self._has_braked = self._is_over = False

    def tick(self, wanted: bool) -> bool:
        """Whether the car brakes in this tick.

        Args:
            wanted: whether it still rolls, or is still to brake.
        """
        brakes = wanted and not self._is_over
        self._is_over = self._has_braked and not brakes
        self._has_braked = self._has_braked or brakes
        return brakes
