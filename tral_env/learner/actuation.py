"""What the actions of learners mean."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Flags
from tral_env.checks import is_number
from tral_env.errors import ConfigError
from tral_env.interface import STEERING, THROTTLE
from tral_env.learner.config import LearnerConfig
from tral_env.learner.features import Values
from tral_env.speed_control import SpeedRegulator

MIN_REVERSE_MPS = 0.25
"""A speed below 0 that is nearer to it is 0: a network that wants to stand is not exact. Source: choice, less than the
0.7 m/s that stand for the throttle with which machines reverse."""


class Actuation:
    """Turns the actions of learners into the commands of n cars, tick by tick."""

    def __init__(self, config: LearnerConfig, n: int) -> None:
        self._is_speed = config.action == "speed"
        self._is_plain = not self._is_speed and config.drive_range is None
        self._low, high = config.drives_from_to
        self._half = (high - self._low) / 2
        self._regulators = [SpeedRegulator() for _ in range(n)] if self._is_speed else []

    def reset(self, rows: Flags) -> None:
        """Forget what was regulated in some cars (n,)."""
        if self._is_speed:
            for row in np.flatnonzero(rows):
                self._regulators[row] = SpeedRegulator()

    def wanted(self, actions: NDArray[np.floating]) -> NDArray[np.float64]:
        """What actions (n, 2) mean: (n, 2) steering, and throttle or speed in m/s. One beyond 1 counts as 1."""
        wanted = np.asarray(actions, np.float64)
        if self._is_plain:
            return wanted
        wanted = np.minimum(np.maximum(wanted, -1.0), 1.0)
        wanted[:, THROTTLE] = _rounded(self._low + (wanted[:, THROTTLE] + 1.0) * self._half)
        if self._is_speed and self._low < 0.0:
            drive = wanted[:, THROTTLE]
            drive[(drive < 0.0) & (drive > -MIN_REVERSE_MPS)] = 0.0
        return wanted

    def command(
        self, wanted: NDArray[np.float64], speed: NDArray[np.floating], rows: Flags | None = None
    ) -> NDArray[np.float64]:
        """Command of one tick.

        Args:
            wanted: (n, 2) of `wanted`.
            speed: (n,) from the hall sensor, m/s.
            rows: (n,) the cars that drive; None: all.

        Returns:
            (n, 2) steering, throttle.
        """
        if not self._is_speed:
            return wanted
        command = wanted.copy()
        speeds, now = wanted[:, THROTTLE].tolist(), speed.tolist()
        if rows is None:
            throttles = [each.drive(*of) for each, *of in zip(self._regulators, speeds, now, strict=True)]
            command[:, THROTTLE] = np.array(throttles, np.float32)
            return command
        for row in np.flatnonzero(rows).tolist():
            command[row, THROTTLE] = self._regulators[row].drive(speeds[row], now[row])
        command[:, THROTTLE] = _rounded(command[:, THROTTLE])
        return command


def _rounded(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values as float32 has them, as policies answer: so environments drive the same bit for bit."""
    return values.astype(np.float32).astype(np.float64)


def inverse(config: LearnerConfig, steering: NDArray[np.floating], drive: NDArray[np.floating]) -> Values:
    """The actions (n, 2) that mean this steering (n,) and this throttle or speed (n,), as far as the range allows."""
    low, high = config.drives_from_to
    actions = np.empty((len(steering), 2), np.float32)
    actions[:, STEERING] = steering
    actions[:, THROTTLE] = (drive - low) * (2 / (high - low)) - 1.0
    np.minimum(np.maximum(actions, -1.0, out=actions), 1.0, out=actions)
    return actions


def check_correction(steering: object, speed: object) -> None:
    """Check how much a correction may change: the steering by an addend, the speed as a share of it.

    Raises:
        ConfigError: one is no number above 0, at most 1.
    """
    for name, bound in (("steering", steering), ("speed", speed)):
        if not is_number(bound) or not 0 < bound <= 1:
            raise ConfigError(f"correction of the {name} = {bound!r}: expected a number above 0, at most 1")


def speed_factors(correction: NDArray[np.floating], bound: float) -> NDArray[np.float64]:
    """What the speeds (n,) that a machine wants are multiplied by: 1 + bound times the second correction of (n, 2)."""
    factors: NDArray[np.float64] = 1.0 + np.clip(correction[:, THROTTLE], -1.0, 1.0).astype(np.float64) * bound
    return factors


def steered(command: NDArray[np.floating], correction: NDArray[np.floating], bound: float) -> NDArray[np.float32]:
    """Commands (n, 2) with bound times the first correction of (n, 2) added to the steering, within [-1, 1]."""
    changed = command.astype(np.float64)
    changed[:, STEERING] += np.clip(correction[:, STEERING], -1.0, 1.0).astype(np.float64) * bound
    return np.clip(changed, -1.0, 1.0).astype(np.float32)
