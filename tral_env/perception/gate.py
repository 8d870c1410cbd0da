"""From markers to what a policy is told: the nearest gate and the nearest single marker."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array, Flags
from tral_env.interface import DICTIONARY_SIZE, GATE_MARKER_IDS, NOTHING_SEEN_ID
from tral_env.se2 import wrap

if TYPE_CHECKING:
    from tral_env.perception.aruco import MarkerPoses


@dataclass(frozen=True, eq=False)
class Detection:
    """What n images show, each array (n,), m and rad in the car's frame; where nothing is seen: id -1, the rest 0.

    The fields mean what the fields of these names in `tral_env.interface` mean.
    """

    gate_id: Array
    gate_x: Array
    gate_y: Array
    gate_heading: Array
    marker_id: Array
    marker_x: Array
    marker_y: Array
    marker_heading: Array

    @classmethod
    def nothing(cls, n: int) -> Detection:
        """What n images without any marker show."""
        no_id, zero = np.full(n, NOTHING_SEEN_ID), np.zeros
        return cls(no_id, zero(n), zero(n), zero(n), no_id.copy(), zero(n), zero(n), zero(n))

    def put(self, rows: NDArray[np.int64], other: Detection) -> None:
        """Write what k other images show into the places `rows` (k,)."""
        for field in fields(self):
            getattr(self, field.name)[rows] = getattr(other, field.name)

    @property
    def gate_seen(self) -> Flags:
        """Whether a complete gate is in view, (n,)."""
        return np.asarray(self.gate_id >= 0)

    @property
    def marker_seen(self) -> Flags:
        """Whether any marker is in view, (n,)."""
        return np.asarray(self.marker_id >= 0)


def nearest_gate_and_marker(ids: NDArray[np.int64], x: Array, y: Array, heading: Array, valid: Flags) -> Detection:
    """Find the nearest complete gate and the nearest marker of each row.

    A gate is complete when both its markers are seen, the left one to the left. Its axis is perpendicular to the line
    between them. Any marker counts as a single marker, those of gates too. All arrays are (n, M); a row has places for
    M markers.

    Args:
        ids: marker ids.
        x: position forward, m.
        y: position left, m.
        heading: direction into the marker, rad.
        valid: whether the place holds a marker that was seen.
    """
    row, place = np.nonzero(valid)
    x, y, heading, marker = x[row, place], y[row, place], heading[row, place], ids[row, place]
    # The far ones come first, so that of two markers of one id the nearer one is written last and stays.
    order = np.argsort(-(x * x + y * y), kind="stable")
    table = np.full((3, len(ids), DICTIONARY_SIZE), np.nan)
    table[:, row[order], marker[order]] = np.stack([x, y, heading])[:, order]
    return Detection(*_nearest_gate(*table), *_nearest(*table))


def nearest_in_image(poses: MarkerPoses) -> Detection:
    """The nearest complete gate and the nearest marker of one image, as a row; see `nearest_gate_and_marker`."""
    valid = np.ones((1, len(poses.ids)), np.bool_)
    return nearest_gate_and_marker(poses.ids[None], poses.x[None], poses.y[None], poses.heading[None], valid)


def _nearest_gate(x: Array, y: Array, heading: Array) -> tuple[Array, Array, Array, Array]:
    """Id, middle and axis of the nearest gate, (n,) each; tables (n, 50) by marker id, NaN: not seen.

    With the left marker at l and the right one at r, ``r - l`` turned left by a quarter is the axis
    ``(l_y - r_y, r_x - l_x)``, which points through the gate.
    """
    left, right = slice(GATE_MARKER_IDS.start, GATE_MARKER_IDS.stop, 2), slice(1, GATE_MARKER_IDS.stop, 2)
    middle_x, middle_y = (x[:, left] + x[:, right]) / 2, (y[:, left] + y[:, right]) / 2
    axis = np.arctan2(x[:, right] - x[:, left], y[:, left] - y[:, right])
    swapped = np.abs(wrap(axis - heading[:, left])) > np.pi / 2
    return _nearest(np.where(swapped, np.nan, middle_x), middle_y, axis)


def _nearest(x: Array, y: Array, heading: Array) -> tuple[Array, Array, Array, Array]:
    """Column, x, y and heading of the nearest entry of tables (n, columns), (n,) each; NaN: no entry."""
    distance = np.where(np.isnan(x), np.inf, x * x + y * y)
    index = np.argmin(distance, axis=1)
    found = np.isfinite(np.min(distance, axis=1))
    x, y, heading = (np.where(found, values[np.arange(len(index)), index], 0.0) for values in (x, y, heading))
    return np.where(found, index, NOTHING_SEEN_ID), x, y, heading
