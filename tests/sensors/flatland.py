"""A flat world of walls for the tests of the ranger: rays against segments, worked out exactly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.config import UltrasonicConfig
from tral_env.sensors import ultrasonic

Array = NDArray[np.float64]
Segment = tuple[float, float, float, float]


def cast(segments: list[Segment], config: UltrasonicConfig) -> tuple[Array, Array]:
    """What the fan of a sensor at the origin, looking along x, hits: distance (1, R), normal (1, R, 2)."""
    angle = ultrasonic.ray_angles(config)
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    distance, normal = np.full(len(angle), np.inf), np.zeros((len(angle), 2))
    for x0, y0, x1, y1 in segments:
        along = np.array([x1 - x0, y1 - y0])
        across = np.array([-along[1], along[0]]) / np.hypot(*along)
        height = across @ [x0, y0]
        if height > 0:
            across, height = -across, -height
        with np.errstate(divide="ignore", invalid="ignore"):
            t = height / (direction @ across)
            place = (t[:, None] * direction - [x0, y0]) @ along / (along @ along)
        nearer = (t > 0) & (place >= 0) & (place <= 1) & (t < distance)
        distance[nearer], normal[nearer] = t[nearer], across
    return np.where(np.isinf(distance), -1.0, distance)[None], normal[None]


def wall(height: float, turned_deg: float, half_length: float = 50.0) -> Segment:
    """A long wall at perpendicular distance `height`; its perpendicular leaves the boresight by `turned_deg`."""
    a = np.radians(turned_deg)
    foot = height * np.array([np.cos(a), np.sin(a)])
    along = half_length * np.array([-np.sin(a), np.cos(a)])
    return (*(foot - along), *(foot + along))


def box(x: float, y: float, half: float) -> list[Segment]:
    """A square post with faces along the axes."""
    corners = [(x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half)]
    return [(*corners[i], *corners[(i + 1) % 4]) for i in range(4)]


def first_echo(segments: list[Segment], config: UltrasonicConfig, softness: float | None = None) -> float:
    distance, normal = cast(segments, config)
    soft = None if softness is None else np.array([softness])
    return float(ultrasonic.echo(distance, normal, config, soft)[0])
