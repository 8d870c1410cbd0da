"""Poses in the plane: compose, invert, transform, wrap, clip.

A pose is x [m], y [m], yaw [rad, counter-clockwise] of a frame in another one. Functions on floats serve one car at a
time; their twins that end in `_n` take arrays of poses (..., 3) and points (..., 2). `wrap`, `rotate` and
`rotate_back` take either.
"""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array

Pose = tuple[float, float, float]
"""x [m], y [m], yaw [rad]."""
Number = TypeVar("Number", float, NDArray[np.float64], NDArray[np.floating])
"""A float, or an array of any shape."""


def clip(value: float, limit: float = 1.0) -> float:
    """Bring a value into [-limit, limit]."""
    return -limit if value < -limit else limit if value > limit else value


def wrap(angle: Number) -> Number:
    """Bring an angle [rad] into [-pi, pi), to rounding: just below -pi it becomes +pi."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def rotate(cos: Number, sin: Number, x: Number, y: Number) -> tuple[Number, Number]:
    """Turn a vector by an angle whose cosine and sine are known: R v, R = [[cos, -sin], [sin, cos]]."""
    return cos * x - sin * y, sin * x + cos * y


def rotate_back(cos: Number, sin: Number, x: Number, y: Number) -> tuple[Number, Number]:
    """Turn a vector back by an angle whose cosine and sine are known: R^T v, the inverse of `rotate`."""
    return cos * x + sin * y, cos * y - sin * x


def to_outer(frame: Pose, x: float, y: float) -> tuple[float, float]:
    """A point that is given in a frame, in the frame around it: p' = R p + t."""
    cos, sin = math.cos(frame[2]), math.sin(frame[2])
    return frame[0] + cos * x - sin * y, frame[1] + sin * x + cos * y


def to_inner(frame: Pose, x: float, y: float) -> tuple[float, float]:
    """A point as seen from a frame: p = R^T (p' - t)."""
    return rotate_back(math.cos(frame[2]), math.sin(frame[2]), x - frame[0], y - frame[1])


def compose(frame: Pose, pose: Pose) -> Pose:
    """A pose that is given in a frame, in the frame around it; its yaw is not wrapped."""
    x, y = to_outer(frame, pose[0], pose[1])
    return x, y, frame[2] + pose[2]


def relative(frame: Pose, pose: Pose) -> Pose:
    """A pose as seen from a frame, its yaw wrapped: the inverse of `compose`."""
    x, y = to_inner(frame, pose[0], pose[1])
    return x, y, wrap(pose[2] - frame[2])


def rotate_n(yaw: Array, vector: Array) -> Array:
    """Vectors (..., 2) turned by angles (...) [rad]."""
    return np.stack(rotate(np.cos(yaw), np.sin(yaw), vector[..., 0], vector[..., 1]), axis=-1)


def to_outer_n(frame: Array, point: Array) -> Array:
    """Points (..., 2) that are given in frames (..., 3), in the frame around them; rounded as `to_outer` rounds."""
    cos, sin = np.cos(frame[..., 2]), np.sin(frame[..., 2])
    x, y = point[..., 0], point[..., 1]
    return np.stack([frame[..., 0] + cos * x - sin * y, frame[..., 1] + sin * x + cos * y], axis=-1)
