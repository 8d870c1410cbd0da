"""Drives for the tests of recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tral_env.interface import CORE_LAYOUT
from tral_env.recording.recorder import Recorder


def observations(ticks: int, seed: int = 0) -> np.ndarray:
    """(ticks, d) float32 with all their digits."""
    return np.random.default_rng(seed).uniform(0.0, 1.0, (ticks, CORE_LAYOUT.size)).astype(np.float32)


def record(path: Path, ticks: int = 5, **told: Any) -> np.ndarray:
    """Record some ticks, 1/80 s apart; gives their observations."""
    rows = observations(ticks)
    with Recorder(path) as recorder:
        for k, row in enumerate(rows):
            recorder.tick(time_s=k / 80, observation=row, action=(0.1, -1 / 3), **told)
    return rows
