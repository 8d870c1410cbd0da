"""What a person wants now, whatever the device, and what a device is."""

from __future__ import annotations

from typing import NamedTuple, Protocol


class Hands(NamedTuple):
    """What a person does with a device."""

    steering: float = 0.0
    """In [-1, 1], +1 = full left, as the stick stands."""
    throttle: float = 0.0
    """In [-1, 1], +1 = full forward, as the triggers stand."""
    holds: bool = False
    """Whether the person holds the dead man's button."""
    arm: bool = False
    """Whether the person asked for that since the last poll."""
    stop: bool = False
    """Whether the person pressed the emergency stop since the last poll."""
    end: bool = False
    """Whether the person asked for the end of the program since the last poll."""


class Device(Protocol):
    """A device in a person's hands."""

    name: str

    def poll(self, now_s: float) -> Hands:
        """What the person does now; at once.

        Args:
            now_s: time on a clock that never goes back, s.

        Raises:
            SourceLostError: the device is gone.
        """
        ...

    def close(self) -> None:
        """Let go of the device; a second call does nothing."""
