"""A person drives by keys of the browser, as by those of a terminal: see `tral_fsm.teleop.keyboard`."""

from __future__ import annotations

import queue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_fsm.evaluation.own_policy import find_policy
from tral_fsm.live.pace import Clock
from tral_fsm.teleop.keyboard import Keyboard
from tral_fsm.teleop.shaping import DeadMan, Shaping, command

BY_HAND = "by hand"
"""The driver of this name is a person."""
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
    """A person as a policy: without a key for 0.7 s the car is in neutral."""

    def __init__(self, keys: Keys, clock: Clock | None = None) -> None:
        """Drive by these keys."""
        terminal: Any = keys
        self._keyboard, self._clock = Keyboard(terminal), clock or Clock()
        self._dead_man, self._holds = DeadMan(), False

    def reset(self, n: int = 1) -> None:
        """Begin anew: no key is held."""
        del n
        self._dead_man = DeadMan()

    def act(self, observation: NDArray[np.floating]) -> NDArray[np.float32]:
        """Command of this tick: (2,) steering, throttle."""
        del observation
        hands = self._keyboard.poll(self._clock.now())
        self._holds = hands.holds
        return np.array(command(hands, Shaping(), self._dead_man), np.float32)

    @property
    def active_states(self) -> list[str]:
        """Whether the person drives."""
        return [BY_HAND if self._holds else "let go"]


def finder(keys: Keys) -> Any:
    """Function that gives the policy of a name, as `find_policy`, or a person at the keys."""
    return lambda name: ByHand(keys) if name == BY_HAND else find_policy(name)
