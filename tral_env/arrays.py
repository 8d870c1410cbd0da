"""Names of the arrays that pass between rooms; their shapes are told where they are used."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers."""
Index = NDArray[np.int64]
"""Rows, ids or counts."""
Flags = NDArray[np.bool_]
"""Yes or no."""
Image = NDArray[np.uint8]
"""Pixels."""
