"""What the environment drives: the actuator's process, or a pulse output in this process."""

from __future__ import annotations

from typing import Protocol

from tral_env.hardware.actuator.settings import Limits, Settings
from tral_env.hardware.pulses import CarCalibration, limit_slew, pulses
from tral_env.hardware.pwm import PulseOutput
from tral_env.interface import CONTROL_PERIOD_S


class Actuator(Protocol):
    """What carries commands out; the environment calls nothing else."""

    @property
    def applied(self) -> tuple[float, float]:
        """Steering and throttle as applied, after all limits."""
        ...

    @property
    def pulses_us(self) -> tuple[float, float]:
        """Pulses that were sent last, us."""
        ...

    @property
    def retries(self) -> int:
        """Number of transactions with the board that were tried again."""
        ...

    def arm(self) -> str:
        """Make ready to drive, in neutral, whatever stopped the car; nothing happens where that was done.

        Returns:
            What had stopped the car, in words; empty: nothing.

        Raises:
            HardwareError: not ready.
        """
        ...

    def resume(self) -> None:
        """Make ready again where quiet alone ended the pulses.

        Raises:
            HardwareError: not ready, or something else stopped the car: only `arm` undoes that.
        """

    def command(self, steering: float, throttle: float, evidence: int) -> None:
        """Send a command in [-1, 1] at once.

        Args:
            steering: share of full lock.
            throttle: share of full throttle.
            evidence: number of observations until now that differed from the one before.

        Raises:
            HardwareError: no answer.
        """

    def check(self) -> None:
        """Find out whether the last command was carried out.

        Raises:
            HardwareError: the car was stopped.
        """

    def stop(self) -> None:
        """Stop the car at once, in an emergency; only `arm` undoes it.

        Raises:
            HardwareError: no answer.
        """

    def neutral(self) -> None:
        """Go to neutral; `arm` has to come before the next command.

        Raises:
            HardwareError: no answer.
        """

    def close(self) -> None:
        """Go to neutral and let go of the device.

        Raises:
            HardwareError: neutral could not be sent.
        """


class PulseActuator:
    """A pulse output in this process. It protects from errors, not from a process that is killed, stopped or hangs."""

    def __init__(self, output: PulseOutput, calibration: CarCalibration) -> None:
        """Take over an output that has sent neutral."""
        self._output, self._calibration = output, calibration
        self.applied, self.pulses_us = (0.0, 0.0), calibration.neutral_us
        self.retries = 0

    def arm(self) -> str:
        """Do nothing: a pulse output knows no arming."""
        return ""

    def resume(self) -> None:
        """Do nothing: a pulse output knows no arming."""

    def command(self, steering: float, throttle: float, evidence: int) -> None:
        """Send the pulses of a command after the slew limit."""
        del evidence
        command = limit_slew([steering, throttle], self.applied, CONTROL_PERIOD_S, self._calibration)
        self.applied = float(command[0]), float(command[1])
        self._send(*pulses(command, self._calibration).tolist())

    def check(self) -> None:
        """Do nothing: `command` raises what is wrong."""

    def stop(self) -> None:
        """Send neutral: nobody here knows whether a brake would be taken for reverse."""
        self.neutral()

    def neutral(self) -> None:
        """Send neutral; the slew limit begins there."""
        self.applied = 0.0, 0.0
        self._send(*self._calibration.neutral_us)

    def close(self) -> None:
        """Close the output."""
        self._output.close()

    def _send(self, steering_us: float, throttle_us: float) -> None:
        self._output.write(steering_us, throttle_us)
        self.pulses_us = steering_us, throttle_us


def actuator_settings(calibration: CarCalibration, bus: int | str, limits: Limits, driver: str = "pca9685") -> Settings:
    """Settings of the actuator's process for a car.

    Args:
        calibration: calibration of the car.
        bus: I2C bus by number or path.
        limits: when it stops the car.
        driver: name of the driver, see `tral_env.hardware.actuator.drivers`.
    """
    steering, throttle = calibration.laws
    return Settings(
        driver=driver,
        bus=bus,
        period_us=calibration.period_us,
        oscillator_hz=calibration.oscillator_hz,
        steering=steering,
        throttle=throttle,
        limits=limits,
    )
