"""Commands with which the contestants drive."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def gentle(n: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Gentle random commands, (n, 2): the cars drive, and crash now and then."""
    return np.stack([rng.uniform(-0.3, 0.3, n), rng.uniform(0.25, 0.5, n)], axis=1).astype(np.float32)
