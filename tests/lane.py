"""A lane of ten steps: an env whose every number can be told by hand."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np

from tral_env.interface import CORE_LAYOUT, action_space

STEPS = 10


class Lane(gym.Env[Any, Any]):
    """Each step drives 0.1 m forward; after ten the episode ends as it was told to."""

    observation_space = CORE_LAYOUT.space()
    action_space = action_space()

    def __init__(self, ending: str = "success", steps: int = STEPS) -> None:
        self.ending, self.steps = ending, steps
        self.k = 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.k, self.options = 0, options
        return self._observation(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.k += 1
        last = self.k == self.steps
        info = {
            "success": last and self.ending == "success",
            "collision": last and self.ending == "collision",
            "crash": last and self.ending == "collision",
            "missed_gate": last and self.ending == "missed_gate",
            "progress": self.k / self.steps,
            "gates_passed": int(self.k >= 5),
            "gates_total": 1,
            # Nothing to measure on the first half, then 3 cm and 4 cm beside the 0.4 m of `Cruiser` in turn.
            "clearance_left_m": (0.43 if self.k % 2 else 0.36) if self.k > 5 else math.nan,
            "clearance_right_m": math.nan,
            "lateral_offset_m": -0.2 if self.k % 2 else 0.1,
            "pose": np.array([0.1 * self.k, 0.0, 0.0]),
            "speed_mps": 0.5,
            "time_s": 0.0125 * self.k,
        }
        truncated = last and self.ending == "timeout"
        return self._observation(), 0.0, last and not truncated, truncated, info

    def _observation(self) -> Any:
        values = {
            "ultrasonic_left": 1.0,
            "distance": 0.1 * self.k,
            "ultrasonic_right": 0.5 + 0.1 * float(self.np_random.random()),
        }
        return CORE_LAYOUT.pack(values, 1)[0]


class Cruiser:
    """Drives straight on; from the fifth tick its state is another."""

    def __init__(self) -> None:
        self.k = 0

    def reset(self, n: int = 1) -> None:
        self.k = 0

    def act(self, observation: Any) -> Any:
        self.k += 1
        return np.array([0.0, 0.25], np.float32)

    @property
    def active_states(self) -> list[str]:
        return ["near" if self.k < 5 else "far"]

    @property
    def wanted_clearance(self) -> Any:
        return np.array([[1.0, 0.4]])
