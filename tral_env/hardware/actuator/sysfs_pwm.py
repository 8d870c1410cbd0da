"""Pulses from the computer's own PWM outputs, by the files of /sys/class/pwm. Source: ABI sysfs-class-pwm of Linux."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from tral_env.errors import HardwareError
from tral_env.hardware.actuator.laws import Channel, clamped
from tral_env.hardware.actuator.options import check_quantities, quantity
from tral_env.hardware.actuator.settings import Settings

_STEERING, _THROTTLE = 0, 1
_NS = 1000
"""Nanoseconds in a microsecond."""
_FILES = ("period", "duty_cycle", "enable", "polarity")
_MAX_BYTES = 64
_NORMAL = "normal"
"""Polarity of an output whose pulses are high."""
_EXPORT_TRIES, _EXPORT_S = 20, 0.05
"""An output is there at most so many times so long after it was asked for: udev gives the rights to its files late."""


@dataclass(frozen=True, kw_only=True)
class SysfsPwmOptions:
    """Two PWM outputs of the computer itself."""

    has_own_clock: ClassVar[bool] = False
    chip: int = quantity(0, 0, 63)
    """Number of the PWM chip, as in /sys/class/pwm/pwmchip0."""
    root: str = "/sys/class/pwm"
    """Folder of the PWM chips."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_quantities(self)

    @property
    def folder(self) -> Path:
        """Folder of the chip."""
        return Path(self.root) / f"pwmchip{self.chip}"

    @property
    def device(self) -> str:
        """The folder of the chip."""
        return str(self.folder)

    def open(self, settings: Settings) -> SysfsPwm:
        """Ask for the outputs; see `tral_env.hardware.actuator.drivers.BoardOptions.open`."""
        return SysfsPwm(self.folder, settings)


class SysfsPwm:
    """Two outputs of one chip; their numbers are the channels of the calibration."""

    def __init__(self, chip: Path, settings: Settings, sleep: Callable[[float], None] = time.sleep) -> None:
        """Ask the kernel for both outputs.

        Raises:
            HardwareError: there are no such outputs, or this user may not use them.
        """
        self._period_ns = round(settings.period_us * _NS)
        self._channels = settings.steering, settings.throttle
        self._on = False
        try:
            self._outputs = [_Output(chip, channel.output, sleep) for channel in self._channels]
        except OSError as error:
            raise HardwareError(
                f"cannot use the PWM outputs of {chip} ({error}). Raspberry Pi: dtoverlay=pwm-2chan in "
                "/boot/firmware/config.txt; add the user to the group gpio"
            ) from error

    def start(self) -> None:
        """Set period and neutral of both outputs, and switch them on."""
        self._on = False
        self._throttle_first(self._set_up)
        self._on = True

    def _set_up(self, number: int) -> None:
        output, channel = self._outputs[number], self._channels[number]
        # No pulse may be longer than its period, also not for a moment; a new output has none and takes no pulse.
        if int(output.get("period")):
            output.put("duty_cycle", 0)
            output.put("enable", 0)
        output.put("period", self._period_ns)
        if output.get("polarity") != _NORMAL:
            output.put("polarity", _NORMAL)
        output.put("duty_cycle", _pulse_ns(channel.centre_us, channel))
        output.put("enable", 1)

    def set_pulses(self, steering_us: float, throttle_us: float) -> None:
        """Send both pulses, rounded to nanoseconds, within the limits of the channels."""

        def send(number: int) -> None:
            pulse_ns = _pulse_ns((steering_us, throttle_us)[number], self._channels[number])
            self._outputs[number].put("duty_cycle", pulse_ns)
            if not self._on:
                self._outputs[number].put("enable", 1)

        self._throttle_first(send)
        self._on = True

    def off(self) -> None:
        """End the pulses. A pulse of no length: some outputs keep their level when disabled."""
        self._on = False

        def end(number: int) -> None:
            self._outputs[number].put("duty_cycle", 0)
            self._outputs[number].put("enable", 0)

        self._throttle_first(end)

    def _throttle_first(self, act: Callable[[int], None]) -> None:
        """Do something to each output by its number: an output that fails keeps the other one from nothing.

        Raises:
            OSError: the first output that failed.
        """
        errors = []
        for number in (_THROTTLE, _STEERING):
            try:
                act(number)
            except OSError as error:
                errors.append(error)
        if errors:
            raise errors[0]

    def check(self) -> str:
        """Read the settings of both outputs back: what is wrong, or nothing."""
        found = [output.get(name) for output in self._outputs for name in ("period", "polarity", "enable")]
        wanted = [str(self._period_ns), _NORMAL, str(int(self._on))] * 2
        return "" if found == wanted else f"period, polarity, enable {', '.join(found)} instead of {', '.join(wanted)}"


class _Output:
    """The files of one output, open: to open one anew for each pulse takes longer than to write it."""

    def __init__(self, chip: Path, number: int, sleep: Callable[[float], None]) -> None:
        """Ask the kernel for the output, and open its files.

        Raises:
            OSError: there is no such output, or this user may not write to it.
        """
        folder = chip / f"pwm{number}"
        if not folder.is_dir():
            (chip / "export").write_text(str(number))
        self._files = {name: _opened(folder / name, sleep) for name in _FILES}

    def put(self, name: str, value: int | str) -> None:
        """Write a setting, which the kernel takes as a whole or refuses."""
        os.pwrite(self._files[name], f"{value}\n".encode(), 0)

    def get(self, name: str) -> str:
        """Read a setting."""
        return os.pread(self._files[name], _MAX_BYTES, 0).decode().strip()


def _pulse_ns(us: float, channel: Channel) -> int:
    return round(clamped(us, channel.min_us, channel.max_us) * _NS)


def _opened(path: Path, sleep: Callable[[float], None]) -> int:
    """A file of an output, open; udev may give the rights to it late.

    Raises:
        OSError: this user may not write to it.
    """
    tries = 0
    while True:
        try:
            return os.open(path, os.O_RDWR | os.O_CLOEXEC)
        except OSError:
            tries += 1
            if tries == _EXPORT_TRIES:
                raise
            sleep(_EXPORT_S)
