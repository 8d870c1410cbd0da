"""Pulses for servo and motor controller: written to a PWM board, or recorded. Neutral comes first and last."""

from __future__ import annotations

import atexit
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, Self

from tral_env.errors import HardwareError
from tral_env.hardware.actuator.laws import STEPS
from tral_env.hardware.actuator.pca9685 import Board
from tral_env.hardware.i2c import Bus, BusName, Smbus
from tral_env.hardware.physical import Physical
from tral_env.hardware.pulses import CarCalibration


class PulseOutput(Protocol):
    """A device that turns pulses into motion; it has sent neutral before anyone gets it."""

    def write(self, steering_us: float, throttle_us: float) -> None:
        """Send both pulses, us, within the hard limits.

        Raises:
            ConfigError: a pulse is not a finite number; nothing has been sent.
            HardwareError: no answer, or closed.
        """

    def close(self) -> None:
        """Send neutral, then let go of the device; a second call does nothing.

        Raises:
            HardwareError: neutral could not be sent.
        """


@dataclass(frozen=True)
class Sent:
    """Two pulses, us, and the time at which they were sent."""

    time_s: float
    steering_us: float
    throttle_us: float


class Recorder:
    """Keeps the pulses that a board would have sent, for dry runs and tests."""

    def __init__(self, calibration: CarCalibration, clock: Callable[[], float] = time.monotonic) -> None:
        """Record neutral.

        Args:
            calibration: calibration of the car.
            clock: gives the time, s.
        """
        self.sent: list[Sent] = []
        self._calibration, self._clock, self._open = calibration, clock, True
        self.write(*calibration.neutral_us)

    def write(self, steering_us: float, throttle_us: float) -> None:
        """Record both pulses; see `PulseOutput.write`."""
        if not self._open:
            raise HardwareError("the recorder is closed: open a new one")
        steering, throttle = self._calibration.limited([steering_us, throttle_us]).tolist()
        self.sent.append(Sent(self._clock(), steering, throttle))

    def close(self) -> None:
        """Record neutral, once."""
        if self._open:
            self.write(*self._calibration.neutral_us)
            self._open = False


_ATTEMPTS = 3
"""Neutral is sent so often before the board counts as lost."""


class Pca9685(Physical):
    """The PCA9685 PWM board.

    The board gets neutral before its outputs wake, and again at its close, at the end of its ``with`` block and at the
    end of the interpreter; it goes on sending neutral then, because a motor controller without pulses may do anything.
    A process that is killed outright (SIGKILL, SIGTERM without a handler) leaves the board with the last pulses: a real
    car is driven by `tral_env.hardware.actuator.client.ActuatorProcess`.
    Source of registers and order: data sheet of NXP, revision 4.
    """

    def __init__(
        self,
        calibration: CarCalibration,
        bus: BusName | Smbus = 1,
        address: int = 0x40,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Open the board, set its period, and send neutral.

        Args:
            calibration: calibration of the car.
            bus: see `Bus`.
            address: address of the board, 7 bit.
            sleep: waits some seconds; the oscillator needs half a millisecond to start.

        Raises:
            MissingExtraError: smbus2 is not installed.
            HardwareError: the bus cannot be opened, or the board does not answer.
        """
        self._calibration = calibration
        self._bus = Bus(bus)
        steering, throttle = calibration.laws
        self._board = Board(
            self._bus.device(address, "PWM board PCA9685"),
            period_us=calibration.period_us,
            oscillator_hz=calibration.oscillator_hz,
            steering=steering,
            throttle=throttle,
            sleep=sleep,
        )
        self._driving, self._closed = True, False
        try:
            self._board.start()
        except BaseException:
            self._bus.close()
            raise
        atexit.register(self.close)

    @property
    def period_us(self) -> float:
        """Time from pulse to pulse, us, as near to the wanted one as the board's divider allows."""
        return self.step_us * STEPS

    @property
    def step_us(self) -> float:
        """The board makes pulses in steps of this length, us: (prescale + 1) / oscillator."""
        return self._board.step_us

    def write(self, steering_us: float, throttle_us: float) -> None:
        """Send both pulses in one transaction, rounded to steps; see `PulseOutput.write`."""
        if not self._driving:
            raise HardwareError("the PWM board is closed: open it anew")
        self._send(steering_us, throttle_us)

    def close(self) -> None:
        """Send neutral, then let go of the bus; see `PulseOutput.close`.

        The board is closed once neutral is out. If neutral fails, the next call and the end of the interpreter try it
        again.
        """
        if self._closed:
            return
        self._driving = False
        self._send_neutral()
        self._closed = True
        atexit.unregister(self.close)
        self._bus.close()

    def __enter__(self) -> Self:
        """The board itself, open."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the board, which sends neutral, whatever happened."""
        self.close()

    def _send(self, steering_us: float, throttle_us: float) -> None:
        self._board.set_pulses(*self._calibration.limited([steering_us, throttle_us]).tolist())

    def _send_neutral(self) -> None:
        for attempt in range(_ATTEMPTS):
            try:
                return self._send(*self._calibration.neutral_us)
            except HardwareError as error:
                if attempt == _ATTEMPTS - 1:
                    error.add_note("Neutral could not be sent: cut the power of the motor.")
                    raise
        return None
