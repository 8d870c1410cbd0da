"""Those who may stop a car while it drives: the devices in a person's hands, and the signals of the system."""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from types import FrameType
from typing import Any, NamedTuple, Self

from tral_env.errors import SourceLostError
from tral_fsm.teleop.hands import Device, Hands


class End(NamedTuple):
    """The end of a drive."""

    why: str
    failed: bool = False
    """Whether it is no end that anyone wished for."""


class Signals:
    """Within its ``with`` block SIGINT, SIGTERM and SIGHUP end the drive at its next tick; a second one at once."""

    NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

    def __init__(self) -> None:
        self.received = ""
        """Name of the first signal; empty: none came."""
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        """Take the signals over."""
        for number in self.NUMBERS:
            self._before[number] = signal.signal(number, self._take)
        return self

    def __exit__(self, *_: object) -> None:
        """Give the signals back."""
        for number, before in self._before.items():
            signal.signal(number, signal.SIG_DFL if before is None else before)

    def _take(self, number: int, frame: FrameType | None) -> None:
        """Note a signal; one that comes after it breaks off, because the drive has not ended: its policy hangs."""
        if self.received:
            raise KeyboardInterrupt
        self.received = signal.Signals(number).name


class Overseer:
    """Polls all devices in each tick. A device that is lost stops the car, and no other one takes its place."""

    def __init__(
        self,
        devices: Sequence[Device],
        clock: Callable[[], float],
        signals: Signals | None = None,
        *,
        must_hold: bool = False,
    ) -> None:
        """Oversee a drive.

        Args:
            devices: the first of them steers, and has the dead man's button.
            clock: a clock that never goes back, s.
            signals: the signals that end the drive.
            must_hold: whether the drive ends when the dead man's button is let go.
        """
        self._devices, self._clock, self._signals, self._must_hold = devices, clock, signals, must_hold
        self.hands = Hands()
        """What the first device said last."""
        self._asks_to_arm = False

    def look(self) -> End | None:
        """Poll all devices; the end of the drive, if somebody wants it."""
        if end := self._poll():
            return end
        if self._must_hold and not self.hands.holds:
            return End(f"the dead man's button of the {self._devices[0].name} was let go")
        return None

    def before_asking(self) -> End | None:
        """Take what waits in the devices: a key that was typed before anyone was asked is no permission to arm."""
        return self._poll()

    def asks_to_arm(self) -> bool | End:
        """Poll all devices before a drive: whether somebody asks to arm; or the end, if somebody wants that.

        Nobody arms with a dead man's button that is not held.
        """
        end = self._poll()
        return end or (self._asks_to_arm and (self.hands.holds or not self._must_hold))

    def _poll(self) -> End | None:
        if self._signals is not None and self._signals.received:
            return End(self._signals.received)
        now_s, all_hands = self._clock(), []
        try:
            for device in self._devices:
                all_hands.append(device.poll(now_s))
        except SourceLostError as error:
            self.hands = Hands()
            return End(str(error), failed=True)
        self.hands = all_hands[0] if all_hands else Hands()
        self._asks_to_arm = any(hands.arm for hands in all_hands)
        for device, hands in zip(self._devices, all_hands, strict=True):
            if hands.stop:
                return End(f"emergency stop by the {device.name}", failed=True)
            if hands.end:
                return End(f"ended by the {device.name}")
        return None
