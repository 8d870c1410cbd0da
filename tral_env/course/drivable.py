"""Whether the car can follow a route: how much it bends, and how near a car on it comes to the boxes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array
from tral_env.config import CarConfig
from tral_env.course.overlap import level_half
from tral_env.course.plan import Plan, steps
from tral_env.errors import CourseError
from tral_env.se2 import rotate_n

CLEARANCE = 0.05
"""The outline of a car on the line keeps at least this far from every box, m."""
_CAR = CarConfig()


def outline(car: CarConfig) -> Array:
    """Points around the car, (P, 2), in its frame."""
    rear = car.middle_x - car.length / 2
    x, y = np.linspace(rear, rear + car.length, 5), np.linspace(-car.width / 2, car.width / 2, 3)
    edge = [(a, b) for a in x for b in y if a in (x[0], x[-1]) or b in (y[0], y[-1])]
    return np.array(edge)


def curvatures(points: Array) -> Array:
    """Curvature of a line at its inner points, (R, 2) -> (R - 2,) 1/m, + to the left."""
    return _curvatures(*_polar_steps(points))


def headings(points: Array) -> Array:
    """Heading of a line at its points, (R, 2) -> (R,) rad, unwrapped."""
    return _headings(_polar_steps(points)[1])


def _polar_steps(points: Array) -> tuple[Array, Array]:
    """Length and heading, unwrapped, of the steps between points, (R, 2) -> (R - 1,) each."""
    x, y, length = steps(points)
    return length, _unwrapped(np.arctan2(y, x))


def _curvatures(length: Array, angle: Array) -> Array:
    """Change of heading over the mean length of the two steps at each inner point."""
    curvature: Array = 2 * (angle[1:] - angle[:-1]) / (length[:-1] + length[1:])
    return curvature


def _headings(angle: Array) -> Array:
    """Mean of the headings of the two steps at each point; at an end that of its one step."""
    return np.concatenate([angle[:1], (angle[:-1] + angle[1:]) / 2, angle[-1:]])


def _unwrapped(angle: Array) -> Array:
    """Angles (R,) without jumps of whole turns; as `np.unwrap`, at a fifth of its cost."""
    jump = np.rint((angle[1:] - angle[:-1]) / (2 * np.pi))
    if not jump.any():
        return angle
    return np.concatenate([angle[:1], angle[1:] - 2 * np.pi * jump.cumsum()])


def clearance(plan: Plan, car: CarConfig | None = None, reach: float = 0.2) -> float:
    """Least distance between the car's outline and any box while the car follows the route, m, at most `reach`.

    Two rectangles that do not overlap are nearest at a corner of one of them. So the distance is the least one of the
    outline's points from the boxes and of the boxes' corners from the outline.
    """
    return _gap(plan, plan.route, headings(plan.route), car or _CAR, reach)


def _gap(plan: Plan, route: Array, yaw: Array, car: CarConfig, reach: float) -> float:
    """As `clearance`, for a car whose rear axle stands at the points `route` (R, 2) with the headings `yaw` (R,)."""
    middle = route + car.middle_x * np.array([np.cos(yaw), np.sin(yaw)]).T
    near_route, near_box = _near(plan, middle, math.hypot(car.length / 2, car.width / 2) + reach)
    if not len(near_route):
        return reach
    route, yaw = route[near_route], yaw[near_route]
    box_yaw, size, box = plan.box_yaw[near_box], plan.box_size[near_box, :2], plan.box_position[near_box, :2]
    yaw, box_yaw = yaw[:, None], box_yaw[:, None]
    points = route[:, None] + rotate_n(yaw, outline(car)[None])
    to_box = _outside(rotate_n(-box_yaw, points - box[:, None]), size[:, None])
    corners = box[:, None] + rotate_n(box_yaw, size[:, None] * [[1, 1], [1, -1], [-1, 1], [-1, -1]])
    local = rotate_n(-yaw, corners - route[:, None]) - [car.middle_x, 0.0]
    to_car = _outside(local, np.array([car.length / 2, car.width / 2]))
    return float(min(reach, to_box.min(), to_car.min()))


_STRETCH = 8
"""`_near` first looks for boxes near this many points of a route at once."""


def _near(plan: Plan, points: Array, radius: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of a point (R, 2) and a box no further apart than `radius`, m; indices, (k,) each."""
    filled = np.concatenate([points, points[-1:].repeat(-len(points) % _STRETCH, axis=0)]).reshape(-1, _STRETCH, 2)
    # Copied: the least of eight arrays is found four times as fast as the least of each eight numbers in a row.
    abreast = filled.transpose(1, 2, 0).copy()
    (x0, y0), (x1, y1) = (abreast.min(axis=0) - radius)[..., None], (abreast.max(axis=0) + radius)[..., None]
    x, y = plan.box_position[:, 0], plan.box_position[:, 1]
    half_x, half_y = level_half(plan.box_size[:, 0], plan.box_size[:, 1], np.cos(plan.box_yaw), np.sin(plan.box_yaw))
    stretch, box = np.nonzero(  # of level rectangles around both
        (x0 < x + half_x) & (x1 > x - half_x) & (y0 < y + half_y) & (y1 > y - half_y)
    )
    if not len(box):
        return stretch, box
    offset = filled[stretch] - plan.box_position[box, None, :2]
    gap = _outside(rotate_n(-plan.box_yaw[box, None], offset), plan.box_size[box, None, :2])
    pair, k = np.nonzero(gap < radius)
    return np.minimum(stretch[pair] * _STRETCH + k, len(points) - 1), box[pair]


def _outside(points: Array, half: Array) -> Array:
    """Distance of points (..., 2) from a level rectangle about the origin, (...) m; 0 inside."""
    gap: Array = np.maximum(np.abs(points) - half, 0.0)
    return np.hypot(gap[..., 0], gap[..., 1])


def check_drivable(plan: Plan, name: str, car: CarConfig | None = None) -> None:
    """Make sure that the car can follow the route.

    Raises:
        CourseError: the route bends more than the car can, or a car on it comes nearer than `CLEARANCE` to a box, or
            the car stands so near to one at the start.
    """
    car = car or _CAR
    length, angle = _polar_steps(plan.route)
    curvature = np.abs(_curvatures(length, angle))
    allowed = float(np.tan(car.full_lock)) / car.wheelbase
    if curvature.max() > allowed:
        x, y = plan.route[1 + curvature.argmax()]
        raise CourseError(
            f"course '{name}': the route bends with a radius of {1 / curvature.max():.2f} m at ({x:.2f}, {y:.2f}). "
            f"Allowed: {1 / allowed:.2f} m or more, the car's full lock"
        )
    # A ring's route does not begin at the start, but in the middle beside it.
    x, y, yaw = plan.start
    start = np.array([[x, y], [x + 0.01 * np.cos(yaw), y + 0.01 * np.sin(yaw)]])
    route, heading = np.concatenate([start, plan.route]), np.concatenate([[yaw, yaw], _headings(angle)])
    if _gap(plan, route, heading, car, CLEARANCE) == CLEARANCE:
        return
    gap = clearance(plan, car, CLEARANCE)
    if gap < CLEARANCE:
        raise CourseError(
            f"course '{name}': on the route the car comes within {gap:.3f} m of a box. Allowed: {CLEARANCE:g} m or more"
        )
    gap = _gap(plan, start, np.array([yaw, yaw]), car, CLEARANCE)
    if gap < CLEARANCE:
        raise CourseError(
            f"course '{name}': /start: the car stands within {gap:.3f} m of a box. Allowed: {CLEARANCE:g} m or more"
        )
