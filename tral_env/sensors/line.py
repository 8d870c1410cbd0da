"""Line sensor: a row of eight reflex photo diodes across the car that look down at floor tape -> one byte. Batched.

The report names a line sensor of one byte and does not use it. The row is a choice, after Pololu's QTR-8 array: eight
diodes 9.525 mm apart.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array
from tral_env.config import LineConfig
from tral_env.se2 import to_outer_n

DIODES = 8
"""The row has so many photo diodes, one for each bit of the byte."""

_BIT = 1 << np.arange(DIODES)


def diode_places(config: LineConfig) -> Array:
    """Places of the diodes in the car's frame, (8, 2) m: x forward, y left; row b is bit b, from right to left."""
    y = (np.arange(DIODES) - (DIODES - 1) / 2) * config.pitch
    return np.column_stack([np.full(DIODES, config.x), y])


def line_byte(pose: Array, tape: Array, config: LineConfig) -> NDArray[np.int64]:
    """Read the line sensors of n cars.

    A diode sees tape if the spot p below it is within half the tape's width of the middle line of a piece. A piece from
    a to b comes nearest to p at ``a + s (b - a)``, ``s = clip((p - a) . (b - a) / |b - a|^2, 0, 1)``. So pieces have
    round ends, and a curve laid from short pieces has no gaps.

    Args:
        pose: (n, 3) x, y, yaw of the cars in the course's frame, m and rad.
        tape: (n, T, 4), or (T, 4) for all, middle lines x0, y0, x1, y1, m. Pieces of no length or with a NaN are none.
        config: the sensor and the tape.

    Returns:
        (n,) 0 .. 255: bit 7 the leftmost diode, 1 = tape.
    """
    places = to_outer_n(pose[:, None], diode_places(config))
    x, y = places[..., 0], places[..., 1]
    x0, y0, x1, y1 = (tape[..., None, :, i] for i in range(4))
    along_x, along_y = x1 - x0, y1 - y0
    square = along_x * along_x + along_y * along_y
    real = square > 0  # false for NaN too
    from_x, from_y = x[..., None] - x0, y[..., None] - y0
    share = np.clip((from_x * along_x + from_y * along_y) / np.where(real, square, 1.0), 0.0, 1.0)
    off_x, off_y = from_x - share * along_x, from_y - share * along_y
    on_tape = real & (off_x * off_x + off_y * off_y <= (config.tape_width / 2) ** 2)
    byte: NDArray[np.int64] = np.where(on_tape.any(axis=-1), _BIT, 0).sum(axis=-1)
    return byte
