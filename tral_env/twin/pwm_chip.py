"""A PWM chip of the kernel as the files of /sys/class/pwm. Source: Documentation/ABI/testing/sysfs-class-pwm."""

from __future__ import annotations

import errno
import stat
from collections.abc import Callable
from dataclasses import dataclass

CHIP = ("pwm", "pwmchip0")
"""Path of the chip below the root of the files."""
_CHIP_FILES = {"export": 0o200, "unexport": 0o200, "npwm": 0o444}
_CHANNEL_FILES = ("period", "duty_cycle", "enable", "polarity")


@dataclass
class _Channel:
    period: int = 0
    duty_cycle: int = 0
    enable: int = 0
    polarity: str = "normal"


class PwmChip:
    """The chip as a `tral_env.twin.devices.FileTree`; times in its files are in ns."""

    def __init__(self, outputs: int = 4, after: Callable[[], None] = lambda: None) -> None:
        """No output is exported.

        Args:
            outputs: how many the chip has.
            after: called after each change.
        """
        self._outputs, self.after = outputs, after
        self._channels: dict[int, _Channel] = {}

    def pulse_us(self, output: int) -> float:
        """Length of the pulse of an output, us; 0: none."""
        channel = self._channels.get(output)
        if channel is None or not channel.enable:
            return 0.0
        high = channel.duty_cycle if channel.polarity == "normal" else channel.period - channel.duty_cycle
        return high / 1e3

    def mode(self, path: tuple[str, ...]) -> int:
        """See `FileTree`."""
        if path in ((), CHIP[:1], CHIP) or self._channel_of(path, 3) is not None:
            return stat.S_IFDIR | 0o755
        if path[:2] == CHIP and len(path) == 3 and path[2] in _CHIP_FILES:
            return stat.S_IFREG | _CHIP_FILES[path[2]]
        if self._channel_of(path, 4) is not None and path[3] in _CHANNEL_FILES:
            return stat.S_IFREG | 0o644
        raise OSError(errno.ENOENT, "no such file")

    def names(self, path: tuple[str, ...]) -> list[str]:
        """See `FileTree`."""
        if len(path) < 2:
            return [CHIP[len(path)]]
        if path == CHIP:
            return [*_CHIP_FILES, *(f"pwm{output}" for output in sorted(self._channels))]
        return list(_CHANNEL_FILES)

    def read(self, path: tuple[str, ...]) -> str:
        """See `FileTree`."""
        if path == (*CHIP, "npwm"):
            return f"{self._outputs}\n"
        channel = self._channel_of(path, 4)
        if channel is None:
            raise OSError(errno.EACCES, "write only")
        return f"{getattr(channel, path[3])}\n"

    def write(self, path: tuple[str, ...], text: str) -> None:
        """See `FileTree`."""
        text = text.strip()
        if path == (*CHIP, "export"):
            self._export(_number(text))
        elif path == (*CHIP, "unexport"):
            if self._channels.pop(_number(text), None) is None:
                raise OSError(errno.ENODEV, "not exported")
        else:
            channel = self._channel_of(path, 4)
            if channel is None or path[3] not in _CHANNEL_FILES:
                raise OSError(errno.EACCES, "read only")
            _set(channel, path[3], text)
        self.after()

    def _export(self, output: int) -> None:
        if output >= self._outputs:
            raise OSError(errno.ENODEV, "no such output")
        if output in self._channels:
            raise OSError(errno.EBUSY, "exported already")
        self._channels[output] = _Channel()

    def _channel_of(self, path: tuple[str, ...], length: int) -> _Channel | None:
        """The exported channel to which a path of this length leads."""
        if len(path) != length or path[:2] != CHIP:
            return None
        return next((channel for output, channel in self._channels.items() if path[2] == f"pwm{output}"), None)


def _set(channel: _Channel, name: str, text: str) -> None:
    """Write a file of a channel.

    Raises:
        OSError: EINVAL or EBUSY, as the kernel answers.
    """
    if name == "polarity":
        if text not in ("normal", "inversed"):
            raise OSError(errno.EINVAL, "no polarity")
        if channel.enable:
            raise OSError(errno.EBUSY, "enabled")
        channel.polarity = text
        return
    value = _number(text)
    after = {each: getattr(channel, each) for each in ("period", "duty_cycle", "enable")} | {name: value}
    if after["duty_cycle"] > after["period"] or (after["enable"] and not after["period"]) or after["enable"] > 1:
        raise OSError(errno.EINVAL, "a duty cycle beyond the period, or no period")
    setattr(channel, name, value)


def _number(text: str) -> int:
    if not text.isdecimal():
        raise OSError(errno.EINVAL, "no number")
    return int(text)
