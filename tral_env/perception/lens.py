"""A lens as equations, without OpenCV: from points before the camera to pixels, and how a camera is turned."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from tral_env.arrays import Array
from tral_env.config import CameraConfig

NEAR = 0.05
"""The camera sees nothing nearer than this, m."""


def mounting_turn(mounting: Array) -> Array:
    """Matrices (k, 3, 3) from the frame of a camera to the car's: ``Rz(yaw) Ry(pitch) Rx(roll)``.

    Args:
        mounting: (k, 3) roll about x forward, pitch about y left (+ looks down), yaw about z up, in this order, rad.
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos(mounting).T, np.sin(mounting).T
    entries = (
        *(cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        *(sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        *(-sp, cp * sr, cp * cr),
    )
    return np.stack(entries, axis=1).reshape(-1, 3, 3)


def project_points(rays: Array, camera: CameraConfig) -> Array:
    """Project points before the camera, by OpenCV's model of a lens.

    With x and y the tangents to the right and down, r^2 = x^2 + y^2 and g = 1 + k1 r^2 + k2 r^4 + k3 r^6:
    ``x' = x g + 2 p1 x y + p2 (r^2 + 2 x^2)``, ``y' = y g + p1 (r^2 + 2 y^2) + 2 p2 x y``,
    ``u = cx + fx x'``, ``v = cy + fy y'``.

    Args:
        rays: (..., 3) forward, left, up from the camera, m.
        camera: the lens.

    Returns:
        (..., 2) u, v in px; NaN for points behind the camera or farther aside than the lens can see.
    """
    ahead = np.where(rays[..., 0] > NEAR, rays[..., 0], np.nan)
    x, y = -rays[..., 1] / ahead, -rays[..., 2] / ahead
    if any(camera.distortion):
        k1, k2, p1, p2, k3 = camera.distortion
        r2 = x * x + y * y
        # Beyond the lens's edge the polynomial turns back and would put points into the image that are not there.
        x = np.where(r2 < _lens_edge(camera), x, np.nan)
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        x, y = (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )
    return np.stack([camera.cx + camera.fx * x, camera.cy + camera.fy * y], axis=-1)


@lru_cache(maxsize=16)
def _lens_edge(camera: CameraConfig) -> float:
    """Square of the largest tangent r of a ray that the image can show, with a tenth to spare.

    The distorted tangent ``r (1 + k1 r^2 + k2 r^4 + k3 r^6)`` grows with r until it turns back; the edge is where it
    reaches the farthest image corner, or where it turns.
    """
    k1, k2, _, _, k3 = camera.distortion
    far = max(
        np.hypot((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy)
        for u in (-0.5, camera.width - 0.5)
        for v in (-0.5, camera.height - 0.5)
    )
    radius = np.linspace(0.0, 4.0, 4001)
    distorted = radius * (1 + k1 * radius**2 + k2 * radius**4 + k3 * radius**6)
    turning = np.flatnonzero(np.diff(distorted) <= 0)
    stop = turning[0] if len(turning) else len(radius) - 1
    return float(radius[min(np.searchsorted(distorted[: stop + 1], 1.1 * far), stop)] ** 2)
