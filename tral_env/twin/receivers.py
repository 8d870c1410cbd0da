"""Servo and motor controller as receivers of pulses: which command a pulse is to them.

What they do with the command, `tral_env.actuation` says. Here stands what only pulses show: a pulse that is none,
pulses that end, and a motor controller that wants to see neutral before it drives.
"""

from __future__ import annotations

from dataclasses import dataclass

from tral_env.hardware.pulses import CarCalibration, action_of

MIN_PULSE_US, MAX_PULSE_US = 800.0, 2200.0
"""A pulse beyond these is no pulse to a servo or a motor controller. Source: choice."""
ARMING_S = 0.5
"""After power-on, neutral has to stand this long until the motor controller drives. Source: choice."""


def is_pulse(us: float) -> bool:
    """Whether a receiver takes this for a pulse."""
    return MIN_PULSE_US <= us <= MAX_PULSE_US


class Servo:
    """The servo: it follows the last pulse, and stays where it is without pulses."""

    def __init__(self, calibration: CarCalibration) -> None:
        """Stand at the middle.

        Args:
            calibration: which pulses this servo takes for left, straight and right.
        """
        self._calibration = calibration
        self.reversed = False
        self._command = 0.0

    def hear(self, pulse_us: float) -> float:
        """Steering command in [-1, 1] that the pulse stands for."""
        if is_pulse(pulse_us):
            centre = self._calibration.neutral_us
            turned = 2 * centre[0] - pulse_us if self.reversed else pulse_us
            self._command = float(action_of([turned, centre[1]], self._calibration)[0])
        return self._command


@dataclass
class MotorController:
    """The motor controller: neutral at power-on arms it, and without pulses it lets the motor run free."""

    calibration: CarCalibration
    """Which pulses this controller takes for reverse, neutral and forward."""
    refuses: bool = False
    """Whether it never arms: a fault."""
    armed: bool = False
    _neutral_since_s: float | None = None

    def power_cycle(self) -> None:
        """Lose the supply and get it back."""
        self.armed, self._neutral_since_s = False, None

    def hear(self, pulse_us: float, now_s: float) -> float:
        """Throttle in [-1, 1] that it obeys at a time, s."""
        if not is_pulse(pulse_us):
            self._neutral_since_s = None
            return 0.0
        section = self.calibration.throttle
        if abs(pulse_us - section.neutral_us) <= max(section.dead_zone_us, 1):
            self._neutral_since_s = now_s if self._neutral_since_s is None else self._neutral_since_s
            self.armed = self.armed or (not self.refuses and now_s - self._neutral_since_s >= ARMING_S)
        else:
            self._neutral_since_s = None
        if self.refuses:
            self.armed = False
        steering_us = self.calibration.neutral_us[0]
        return float(action_of([steering_us, pulse_us], self.calibration)[1]) if self.armed else 0.0
