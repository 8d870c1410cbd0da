"""The registers of the PWM board PCA9685. Source: data sheet of NXP, revision 4."""

from __future__ import annotations

import time
from collections.abc import Callable

from tral_env.hardware.actuator.laws import Channel, board_steps, prescale, step_us
from tral_env.hardware.i2c import Device

_MODE1, _MODE2, _LED0, _ALL_LED, _PRESCALE = 0x00, 0x01, 0x06, 0xFA, 0xFE
_SLEEP, _AUTO_INCREMENT, _EXTERNAL_CLOCK, _RESTART, _TOTEM_POLE = 0x10, 0x20, 0x40, 0x80, 0x04
_FULL_OFF = (0, 0, 0, 0x10)
"""Registers of an output that makes no pulses."""
_OUTPUTS = 16
_WAKE_UP_S = 0.001
"""The oscillator runs this long after it was woken; the data sheet asks for half a millisecond."""


class Board:
    """The board as a driver of the worker, see `tral_env.hardware.actuator.drivers.Driver`."""

    def __init__(
        self,
        device: Device,
        *,
        period_us: float,
        oscillator_hz: float,
        steering: Channel,
        throttle: Channel,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Name the board; nothing is sent yet. Its two outputs are neighbours, so that one transaction sets both."""
        self._device, self._sleep = device, sleep
        self._divider = prescale(oscillator_hz, period_us)
        self.step_us = step_us(self._divider, oscillator_hz)
        self._channels = (steering, throttle)
        self._first = _LED0 + 4 * min(steering.output, throttle.output)

    def start(self) -> None:
        """Set the divider while the board sleeps, give it neutral, and wake it.

        Raises:
            HardwareError: no answer, or another device.
        """
        # A board that sleeps sends nothing and takes a new divider. It also stops answering to its second address
        # 0x70, which is that of the first ultrasonic.
        self._device.write(_MODE1, _SLEEP | _AUTO_INCREMENT)
        if self._device.read(_MODE1)[0] & _EXTERNAL_CLOCK:
            raise self._device.nonsense(
                "waits for a clock at its pin EXTCLK, which only a power cycle undoes: take the board's supply away "
                "and give it back"
            )
        self._device.write(_PRESCALE, self._divider)
        if (got := self._device.read(_PRESCALE)[0]) != self._divider:
            raise self._device.nonsense(f"reads back a divider of {got} instead of {self._divider}: another device?")
        self._device.write(_MODE2, _TOTEM_POLE)
        self.set_pulses(*(channel.centre_us for channel in self._channels))
        self._device.write(_MODE1, _AUTO_INCREMENT)
        self._sleep(_WAKE_UP_S)
        if self._device.read(_MODE1)[0] & _RESTART:
            self._device.write(_MODE1, _AUTO_INCREMENT | _RESTART)

    def set_pulses(self, steering_us: float, throttle_us: float) -> None:
        """Send both pulses in one transaction, rounded to steps, within the limits of the channels."""
        # Of each output: on at step 0, off at its step. The board takes them over at the end of the transaction: both
        # or none, unless the transaction breaks off, see docs/safety.md.
        ends = [
            board_steps(us, channel, self.step_us)
            for us, channel in zip((steering_us, throttle_us), self._channels, strict=True)
        ]
        outputs = [channel.output for channel in self._channels]
        self._device.write(
            self._first,
            *(byte for _, end in sorted(zip(outputs, ends, strict=True)) for byte in (0, 0, end & 0xFF, end >> 8)),
        )

    def off(self) -> None:
        """End the pulses of both outputs, in one transaction."""
        self._device.write(self._first, *_FULL_OFF, *_FULL_OFF)

    def check(self) -> str:
        """Read back the settings, which a board loses when its supply breaks down: what is wrong, or nothing."""
        modes = self._device.read(_MODE1)[0] & ~_RESTART, self._device.read(_MODE2)[0]
        divider, wanted = self._device.read(_PRESCALE)[0], (_AUTO_INCREMENT, _TOTEM_POLE)
        if (modes, divider) == (wanted, self._divider):
            return ""
        return (
            f"MODE1 0x{modes[0]:02x}, MODE2 0x{modes[1]:02x}, divider {divider} instead of 0x{wanted[0]:02x}, "
            f"0x{wanted[1]:02x}, {self._divider}"
        )


def all_off(device: Device) -> None:
    """End the pulses of all outputs of a board, whatever its settings are."""
    device.write(_ALL_LED + 3, _FULL_OFF[3])


def still_on(device: Device) -> list[int]:
    """Outputs of a board that do not read back as off."""
    return [output for output in range(_OUTPUTS) if not device.read(_LED0 + 4 * output + 3)[0] & _FULL_OFF[3]]
