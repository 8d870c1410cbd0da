"""The environment as Gymnasium makes it, and commands to drive it with."""

import gymnasium as gym
import numpy as np


def corridor(**kwargs: object) -> gym.Env:
    return gym.make("TralCorridor-v0", **kwargs)


def commands(ticks: int, n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.stack([rng.uniform(-0.2, 0.6, (ticks, n)), rng.uniform(0.3, 0.7, (ticks, n))], axis=2)
