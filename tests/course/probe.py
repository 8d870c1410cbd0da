"""Probing a plan without the code that made it."""

from __future__ import annotations

import cv2
import numpy as np

from tral_env.course.plan import BOX_KINDS, Plan

CELL = 0.02
"""m"""


def flat(plan: Plan, *kinds: str) -> np.ndarray:
    """Rectangles x0, y0, x1, y1 of the boxes of some kinds, which must be at right angles."""
    which = np.isin(plan.box_kind, [BOX_KINDS.index(kind) for kind in kinds])
    sideways = np.abs(np.sin(plan.box_yaw)) > 0.5
    half = np.where(sideways[:, None], plan.box_size[:, 1::-1], plan.box_size[:, :2])
    return np.hstack([plan.box_position[:, :2] - half, plan.box_position[:, :2] + half])[which]


def flooded(plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Cells of 2 cm that water poured out at the start reaches, (h, w) bool, and the corner (x, y) of the first."""
    solid = flat(plan, "wall", "door")
    # No edge shall run through the middle of a cell, where rounding would decide.
    corner = solid[:, :2].min(axis=0) - 5.1234 * CELL
    shape = np.ceil((solid[:, 2:].max(axis=0) + 5 * CELL - corner) / CELL).astype(int)
    dry = np.zeros((shape[1], shape[0]), np.uint8)
    for rect in solid:
        # A cell is solid where its middle is.
        x0, y0, x1, y1 = np.ceil((rect - np.tile(corner, 2)) / CELL - 0.5).astype(int)
        dry[y0:y1, x0:x1] = 1
    at = ((plan.start[:2] - corner) / CELL).astype(int)
    cv2.floodFill(dry, None, (int(at[0]), int(at[1])), 2)
    return dry == 2, corner


def leaks(plan: Plan) -> bool:
    """Whether water poured out at the start gets out."""
    wet, _ = flooded(plan)
    return bool(wet[[0, -1]].any() or wet[:, [0, -1]].any())


def overlaps(plan: Plan) -> float:
    """Largest area that two boxes share, m2: upright ones exactly, turned ones by cv2's convex polygons."""
    worst = 0.0
    polygons = [
        cv2.boxPoints((p[:2], (2 * s[0], 2 * s[1]), float(np.degrees(y))))
        for p, s, y in zip(plan.box_position.tolist(), plan.box_size.tolist(), plan.box_yaw, strict=True)
    ]
    reach = np.hypot(plan.box_size[:, 0], plan.box_size[:, 1])
    for i, j in np.argwhere(
        np.triu(
            np.linalg.norm(plan.box_position[:, None, :2] - plan.box_position[None, :, :2], axis=2)
            < reach[:, None] + reach[None],
            1,
        )
    ):
        worst = max(worst, cv2.intersectConvexConvex(polygons[i], polygons[j])[0])
    return float(worst)


def hidden(plan: Plan, eye: np.ndarray, target: np.ndarray) -> bool:
    """Whether any box stands between two points of the floor."""
    line = eye + np.linspace(0.0, 1.0, 400)[:, None] * (target - eye)
    offset = line[:, None] - plan.box_position[None, :, :2]
    c, s = np.cos(plan.box_yaw), np.sin(plan.box_yaw)
    x, y = c * offset[..., 0] + s * offset[..., 1], c * offset[..., 1] - s * offset[..., 0]
    return bool(((np.abs(x) < plan.box_size[:, 0]) & (np.abs(y) < plan.box_size[:, 1])).any())
