"""A person drives: by keys of the browser, or by a gamepad of this computer, by the laws of `tral_fsm.teleop`."""

from __future__ import annotations

import queue
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.interface import Policy
from tral_fsm.evaluation.own_policy import find_policy
from tral_fsm.live.pace import Clock
from tral_fsm.teleop.gamepad import open_gamepad
from tral_fsm.teleop.hands import Device
from tral_fsm.teleop.keyboard import Keyboard
from tral_fsm.teleop.shaping import DeadMan, Shaping, command

BY_HAND = "by hand"
"""The driver of this name is a person at the keys."""
GAMEPAD = "gamepad"
"""The driver of this name is a person with a gamepad."""
KEYS: dict[Any, str] = {"W": "drive on", "S": "brake, then back", "A": "steer left", "D": "steer right"}


class Keys:
    """The keys that were pressed in any browser since they were asked for."""

    def __init__(self) -> None:
        self._pressed: queue.SimpleQueue[str] = queue.SimpleQueue()

    def press(self, key: str) -> None:
        """Take a key; any thread may."""
        self._pressed.put(key.lower())

    def keys(self) -> str:
        """As `Terminal.keys`."""
        found = ""
        while not self._pressed.empty():
            found += self._pressed.get()
        return found


class ByHand:
    """A person as a policy: the car is in neutral while the hand is gone."""

    def __init__(self, device: Device, clock: Clock | None = None) -> None:
        """Drive by a device."""
        self._device, self._clock = device, clock or Clock()
        self._dead_man, self._holds = DeadMan(), False

    def reset(self, n: int = 1) -> None:
        """Begin anew: what is held has to be let go once."""
        del n
        self._dead_man = DeadMan()

    def act(self, observation: NDArray[np.floating]) -> NDArray[np.float32]:
        """Command of this tick: (2,) steering, throttle.

        Raises:
            SourceLostError: the device is gone.
        """
        del observation
        hands = self._device.poll(self._clock.now())
        self._holds = hands.holds
        return np.array(command(hands, Shaping(), self._dead_man), np.float32)

    @property
    def active_states(self) -> list[str]:
        """Whether the person drives."""
        return [BY_HAND if self._holds else "let go"]


class Finder:
    """Gives the policy of a name, as `find_policy`, or a person."""

    def __init__(self, keys: Keys, open_pad: Callable[[], Device] = open_gamepad) -> None:
        """Remember where a person's hands are.

        Args:
            keys: of the page.
            open_pad: opens the gamepad when it is asked for.
        """
        self._terminal: Any = keys
        self._open_pad = open_pad
        self._pad: Device | None = None

    def __call__(self, name: str) -> Policy:
        """Find a policy.

        Raises:
            TralError: there is no such policy, or no gamepad.
        """
        if name == BY_HAND:
            return ByHand(Keyboard(self._terminal))
        if name != GAMEPAD:
            return find_policy(name)
        self.close()
        self._pad = self._open_pad()
        return ByHand(self._pad)

    def close(self) -> None:
        """Let go of the gamepad."""
        if self._pad is not None:
            self._pad.close()
            self._pad = None
