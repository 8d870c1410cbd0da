"""What lies outside the picture of a camera: OpenGL would take its time for it and draw nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array
from tral_env.perception.rays import cross


@dataclass(frozen=True, kw_only=True, eq=False)
class Frustum:
    """The pyramid that a camera looks into; its edges are slopes: metres to the side for each metre ahead."""

    position: Array
    """(3,) place of the camera, m."""
    forward: Array
    """(3,) unit vector."""
    up: Array
    """(3,) unit vector, square to `forward`."""
    left: float
    right: float
    bottom: float
    top: float

    def outside(self, centre: Array, radius: Array) -> NDArray[np.bool_]:
        """Which of m spheres no part of the picture shows; a sphere near a corner may count as inside.

        Args:
            centre: (m, 3) m.
            radius: (m,) m; 0 or less: without end, never outside.

        Returns:
            (m,).
        """
        across = cross(self.forward, self.up)
        ahead, side, rise = np.stack([self.forward, across, self.up]) @ (centre - self.position).T
        beyond: NDArray[np.bool_] = (ahead < -radius) & (radius > 0)
        for along, slope in ((side, self.right), (-side, -self.left), (rise, self.top), (-rise, -self.bottom)):
            beyond |= (along - slope * ahead > radius * np.hypot(1.0, slope)) & (radius > 0)
        return beyond
