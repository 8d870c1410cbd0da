"""The gamepad of 2016, an XBOX pad, by the kernel's events (evdev)."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Protocol, cast

from tral_env.errors import ConfigError, HardwareError, MissingExtraError, SourceLostError
from tral_fsm.teleop.hands import Hands

_SYN, _KEY, _ABS = 0, 1, 3
"""Types of events; see linux/input-event-codes.h."""
_DROPPED = 3
"""The kernel's buffer ran over, and events are missing."""
_STEERING, _BACKWARD, _FORWARD = 0x00, 0x02, 0x05
"""Axes: left stick to the right, left trigger, right trigger."""
_HOLD, _STOP, _ARM, _END = 0x136, 0x131, 0x13B, 0x13A
"""Buttons: LB, B, start, back."""
MAX_QUIET_S = 3.0
"""A trigger that a finger holds between its ends is never this quiet, s: the pad is out of reach, or its program hangs.
Source: choice."""
_AT_END = 0.9
"""A trigger beyond this, in [-1, 1], is at rest or at its end stop, where a healthy pad says nothing for long. Source:
choice; the axes of triggers go from -1 to 1."""
_MAX_READS = 64
"""A poll reads so often, at most; evdev gives 64 events at once, and the kernel keeps some hundreds."""


class Event(Protocol):
    """An event of evdev."""

    type: int
    code: int
    value: int


class EventDevice(Protocol):
    """The part of ``evdev.InputDevice`` that is used here."""

    name: str
    path: str

    def read(self) -> Iterable[Event]:
        """Events that wait; BlockingIOError: none; OSError: the device is gone."""
        ...

    def absinfo(self, axis: int) -> Any:
        """``min`` and ``max`` of an axis."""
        ...

    def close(self) -> None:
        """Let go of the device."""


class Gamepad:
    """An XBOX pad: left stick steers, right trigger drives, left trigger brakes and reverses.

    LB is the dead man's button, B the emergency stop, start arms, back ends the program.
    """

    def __init__(self, device: EventDevice, max_quiet_s: float = MAX_QUIET_S) -> None:
        """Take an open device over.

        Raises:
            ConfigError: it lacks an axis.
        """
        self._device, self._max_quiet_s = device, max_quiet_s
        self.name = f"gamepad {device.name} ({device.path})"
        self._range: dict[int, tuple[int, int]] = {}
        for axis in (_STEERING, _BACKWARD, _FORWARD):
            info = device.absinfo(axis)
            if not info.max > info.min:
                raise ConfigError(f"{self.name}: axis {axis} goes from {info.min} to {info.max}: expected an XBOX pad")
            self._range[axis] = (info.min, info.max)
        self._axes = {_STEERING: 0.0, _BACKWARD: -1.0, _FORWARD: -1.0}
        self._holds, self._heard_s = False, float("-inf")
        self._closed = False

    def poll(self, now_s: float) -> Hands:
        """See `Device.poll`."""
        pressed = set()
        for event in self._events():
            self._heard_s = now_s
            if event.type == _ABS and event.code in self._range:
                low, high = self._range[event.code]
                self._axes[event.code] = 2.0 * (event.value - low) / (high - low) - 1.0
            elif event.type == _KEY and event.code == _HOLD:
                self._holds = event.value > 0
            elif event.type == _KEY and event.value == 1:
                pressed.add(event.code)
            elif event.type == _SYN and event.code == _DROPPED:
                self._holds = False  # whatever it was: it has to be pressed anew
        throttle = (self._axes[_FORWARD] - self._axes[_BACKWARD]) / 2.0
        pulled = any(abs(self._axes[axis]) < _AT_END for axis in (_BACKWARD, _FORWARD))
        if self._holds and pulled and now_s - self._heard_s > self._max_quiet_s:
            raise SourceLostError(
                f"{self.name} has said nothing for {self._max_quiet_s:g} s while a trigger is half held: out of reach?"
            )
        return Hands(-self._axes[_STEERING], throttle, self._holds, _ARM in pressed, _STOP in pressed, _END in pressed)

    def close(self) -> None:
        """See `Device.close`."""
        if not self._closed:
            self._closed = True
            self._device.close()

    def _events(self) -> Iterable[Event]:
        """All events that wait: one left over would be done a tick late, or arm a drive that began later."""
        events: list[Event] = []
        try:
            for _ in range(_MAX_READS):
                events += self._device.read()
        except BlockingIOError:
            return events
        except OSError as error:
            raise SourceLostError(f"{self.name} is gone ({error})") from error
        return events


def open_gamepad(path: str | None = None) -> Gamepad:
    """Open a gamepad.

    Args:
        path: its file, such as /dev/input/event5; None: the first that has a stick, two triggers and the buttons.

    Raises:
        MissingExtraError: evdev is not installed.
        HardwareError: there is none, or it cannot be opened.
    """
    try:
        import evdev
    except ImportError as error:
        raise MissingExtraError("evdev", "gamepad", "a gamepad") from error
    found = []
    for each in [path] if path is not None else sorted(map(str, Path("/dev/input").glob("event*"))):
        try:
            device = evdev.InputDevice(each)
        except OSError as error:
            found.append(f"{each}: {error}")
            continue
        has = device.capabilities(absinfo=False)
        if {_STEERING, _BACKWARD, _FORWARD} <= set(has.get(_ABS, ())) and _HOLD in has.get(_KEY, ()):
            return Gamepad(cast("EventDevice", device))
        found.append(f"{each}: {device.name} is no XBOX pad")
        device.close()
    raise HardwareError(
        f"no gamepad: {'; '.join(found) or 'no file /dev/input/event*'}. Plug it in; its user is in the group input"
    )
