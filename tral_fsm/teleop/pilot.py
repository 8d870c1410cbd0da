"""A person as a policy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.errors import ConfigError
from tral_fsm.teleop.overseer import Overseer
from tral_fsm.teleop.shaping import DeadMan, Shaping, command


class Pilot:
    """Answers in each tick what the hands of a person want."""

    needed_readings: frozenset[str] = frozenset()
    """A person sees without sensors."""

    def __init__(self, overseer: Overseer, shaping: Shaping | None = None) -> None:
        """Let a person drive whose hands an overseer polls."""
        self._overseer, self._shaping = overseer, shaping or Shaping()
        self._dead_man = DeadMan()

    def reset(self, n: int = 1) -> None:
        """Begin anew: the throttle has to be at rest before it counts.

        Raises:
            ConfigError: a person drives one car.
        """
        if n != 1:
            raise ConfigError(f"a person drives one car, got {n}")
        self._dead_man = DeadMan()

    def act(self, observation: NDArray[np.floating]) -> NDArray[np.float32]:
        """Command of this tick: (2,) steering, throttle."""
        return np.array(command(self._overseer.hands, self._shaping, self._dead_man), np.float32)

    @property
    def active_states(self) -> list[str]:
        """Whether the person drives."""
        return ["by hand" if self._overseer.hands.holds else "let go"]
