"""The task as pure functions on arrays: where a car is on its route, what that counts as, what it earns.

Every array has the cars along its first axis; n is the number of cars. Numbers: `TaskConfig`.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from tral_env.arrays import (
    ALL,
    ALONE,
    Array,
    Index,
    Rows,
    Values,
    columns,
    maximum,
    minimum,
    number,
    plain,
    spread,
)
from tral_env.config import CarConfig, TaskConfig
from tral_env.course.plan import Plan, arc_length
from tral_env.se2 import rotate_back

ROUTE_WINDOW = (3, 6)
"""Route points behind and ahead of the last one that are looked at, so that a car cannot jump to another leg."""
_NEARBY = np.arange(-ROUTE_WINDOW[0], ROUTE_WINDOW[1])
CUT_M = 0.85
"""A car farther from its route than this, m, may have cut a corner beyond the centre of the curve (radius 0.9 m). The
legs before and behind the corner are then nearer than the curve, and only a long look finds the way across."""
_FAR = np.arange(-16, 64)
_SAME_WAY = -0.3
"""A long look takes a place only if the cosine between the route there and here is at least this: it looks around one
corner, not into the leg that comes back."""
_CLEARLY = 0.8
"""A long look takes a place only if its distance is less than this share of the distance here: a leg behind a thin wall
is not."""
GATE_REACH_M = 3.0
"""The plane of a gate ends this far from its middle, m."""
GATE_ROUTE_REACH_M = 1.5
"""A gate counts while the car's place on the route is this near to the gate's, m."""
_NO_STRAIGHT = -1.0
"""Stands for a straight that is not there: a stretch of negative length holds no car."""


@dataclass(eq=False)
class Track:
    """The plans of n cars, padded to common shapes."""

    segments: Array
    """(n, R, 6) point of the route, m; unit vector from it to the next one, 0 at the end; arc length here and at the
    next one, m. The last point is repeated."""
    last: Index
    """(n,) index of the last point."""
    gate_pose: Array
    """(n, G, 3) x [m], y [m], yaw [rad]; NaN where there is none."""
    gate_unit: Array
    """(n, G, 2) cosine and sine of the gates' yaw; NaN where there is none."""
    gate_width: Array
    """(n, G) distance between the posts, m."""
    gate_s: Array
    """(n, G) place of the gates on the route, m; infinite where there is none."""
    gates: Index
    """(n,) number of gates."""
    straights: Array
    """(n, S, 5) x [m], y [m], yaw [rad], length [m], width [m]; all are `_NO_STRAIGHT` where there is none."""
    straight_unit: Array
    """(n, S, 2) cosine and sine of the straights' yaw."""

    @property
    def route(self) -> Array:
        """(n, R, 2) points, m."""
        return self.segments[..., :2]

    @property
    def route_unit(self) -> Array:
        """(n, R, 2) unit vector from each point to the next one; 0 at the end."""
        return self.segments[..., 2:4]

    @property
    def route_s(self) -> Array:
        """(n, R) arc length at the points, m."""
        lengths: Array = self.segments[..., 4]
        return lengths

    @property
    def length(self) -> Array:
        """(n,) length of the routes, m."""
        lengths: Array = self.route_s[:, -1]
        return lengths


def empty_track(n: int) -> Track:
    """Track of n cars that have no courses yet."""
    return Track(
        segments=np.zeros((n, 2, 6)),
        last=np.ones(n, np.int64),
        gate_pose=np.zeros((n, 0, 3)),
        gate_unit=np.zeros((n, 0, 2)),
        gate_width=np.zeros((n, 0)),
        gate_s=np.zeros((n, 0)),
        gates=np.zeros(n, np.int64),
        straights=np.zeros((n, 0, 5)),
        straight_unit=np.zeros((n, 0, 2)),
    )


def lay(track: Track, row: int, plan: Plan) -> None:
    """Write the plan of one car into the track, in place; arrays grow where the plan is larger.

    Several laps become one long route with the gates of each lap.
    """
    route, route_s, gate_s, gate_pose, gate_width = _laps(plan)
    points, gates, straights = len(route), len(gate_s), len(plan.straights)
    track.segments = _grown(track.segments, points, edge=True)
    track.gate_pose = _grown(track.gate_pose, gates, fill=np.nan)
    track.gate_unit = _grown(track.gate_unit, gates, fill=np.nan)
    track.gate_width = _grown(track.gate_width, gates)
    track.gate_s = _grown(track.gate_s, gates, fill=np.inf)
    track.straights = _grown(track.straights, straights, fill=_NO_STRAIGHT)
    track.straight_unit = _grown(track.straight_unit, straights)
    along = route[1:] - route[:-1]
    laid = track.segments[row]
    laid[:points, :2], laid[:points, 4] = route, route_s
    laid[: points - 1, 2:4] = along / np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)[:, None]
    laid[: points - 1, 5] = route_s[1:]
    laid[points - 1, 2:] = 0.0, 0.0, route_s[-1], route_s[-1]
    laid[points:] = laid[points - 1]
    track.last[row] = points - 1
    track.gate_pose[row], track.gate_pose[row, :gates] = np.nan, gate_pose
    _write_unit(track.gate_unit[row], track.gate_pose[row, :, 2])
    track.gate_width[row, :gates] = gate_width
    track.gate_s[row], track.gate_s[row, :gates] = np.inf, gate_s
    track.gates[row] = gates
    track.straights[row], track.straights[row, :straights] = _NO_STRAIGHT, plan.straights
    _write_unit(track.straight_unit[row], track.straights[row, :, 2])


def _write_unit(unit: Array, yaw: Array) -> None:
    """Write cosine and sine of angles (k,) into `unit` (k, 2)."""
    np.cos(yaw, out=unit[:, 0])
    np.sin(yaw, out=unit[:, 1])


def _laps(plan: Plan) -> tuple[Array, Array, Array, Array, Array]:
    """Points of all laps with their arc length; place, pose and width of the gates of all laps."""
    if plan.laps == 1:
        return plan.route, plan.route_s, plan.gate_s, plan.gate_pose, plan.gate_width
    route = np.concatenate([np.tile(plan.route[:-1], (plan.laps, 1)), plan.route[-1:]])
    route_s = arc_length(route)
    lap = np.repeat(np.arange(plan.laps), len(plan.gate_pose))
    gate_s = np.tile(plan.gate_s, plan.laps) + lap * route_s[len(plan.route) - 1]
    return route, route_s, gate_s, np.tile(plan.gate_pose, (plan.laps, 1)), np.tile(plan.gate_width, plan.laps)


def _grown(array: Array, size: int, *, fill: float = 0.0, edge: bool = False) -> Array:
    """The array with room for `size` entries along its second axis."""
    missing = size - array.shape[1]
    if missing <= 0:
        return array
    width = [(0, 0), (0, missing)] + [(0, 0)] * (array.ndim - 2)
    return np.pad(array, width, mode="edge") if edge else np.pad(array, width, constant_values=fill)


def locate(track: Track, rows: Rows, position: Array, index: Values) -> tuple[Values, Values, Values]:
    """Project positions onto the routes, near where the cars last were.

    Args:
        track: the routes.
        rows: the cars, k.
        position: (k, 2) of the rear axle, m.
        index: (k,) route segment where each car last was, or the number of a car alone.

    Returns:
        (k,) arc length [m], (k,) signed distance to the route [m], left positive, (k,) segment; numbers of a car alone.
    """
    if isinstance(rows, int):
        return _locate_alone(track, position, index)
    s, lateral, segment, _ = _nearest(track, rows, position, index, _NEARBY, same_way=False)
    far = np.flatnonzero(np.abs(lateral) > CUT_M)
    if not len(far):
        return s, lateral, segment
    cars = np.arange(len(track.last))[rows]
    *places, square = _nearest(track, cars[far], position[far], segment[far], _FAR, same_way=True)
    across = np.sqrt(square) < _CLEARLY * np.abs(lateral[far])
    for values, there in zip((s, lateral, segment), places, strict=True):
        values[far[across]] = there[across]
    return s, lateral, segment


def _locate_alone(track: Track, position: Array, index: int) -> tuple[float, float, int]:
    """As `locate`, for a car alone; only far from the route it looks as the others do."""
    found = _nearest_alone(track, position, index)
    if abs(found[1]) <= CUT_M:
        return found
    s, lateral, segment = map(number, locate(track, np.zeros(1, np.int64), position, np.array([index])))
    return s, lateral, segment


def _nearest(
    track: Track, rows: Index | slice, position: Array, index: Index, around: Index, *, same_way: bool
) -> tuple[Array, Array, Index, Array]:
    """As `locate`, among the segments `around` the last one; and the square of the distance, (k,) m^2.

    With `same_way` the segments that lead elsewhere do not count, see `_SAME_WAY`.
    """
    segment, window = _window(track, rows, index, around)
    square, s, lateral = _projected(window, position[:, :1], position[:, 1:])
    if same_way:
        ux, uy, here = window[2], window[3], -around[:1]
        square = np.where(ux * ux[:, here] + uy * uy[:, here] < _SAME_WAY, np.inf, square)
    at = np.arange(len(position)), square.argmin(axis=1)
    return s[at], lateral[at], segment[at], square[at]


def _nearest_alone(track: Track, position: Array, index: int) -> tuple[float, float, int]:
    """As `locate` without the long look, for a car alone, segment by segment."""
    x, y = position[ALONE].tolist()
    first, end = max(index - ROUTE_WINDOW[0], 0), min(index + ROUTE_WINDOW[1], track.last.item(ALONE))
    found = [_projected(segment, x, y) for segment in track.segments[ALONE, first:end].tolist()]
    squares, places, laterals = zip(*found, strict=True)
    nearest = squares.index(min(squares))
    return places[nearest], laterals[nearest], first + nearest


def _projected(segment: Any, px: Any, py: Any) -> tuple[Values, Values, Values]:
    """Square of the distance [m^2] of points from segments, and arc length and signed distance there, m.

    All numbers, or all arrays; `segment` has what `Track.segments` tells of it.
    """
    x, y, ux, uy, s, end = segment
    dx, dy = px - x, py - y
    t = minimum(maximum(dx * ux + dy * uy, 0.0), end - s)
    off_x, off_y = dx - ux * t, dy - uy * t
    return off_x * off_x + off_y * off_y, s + t, ux * dy - uy * dx


def _window(track: Track, rows: Index | slice, index: Index, around: Index) -> tuple[Index, Array]:
    """The segments around the last one, (k, W), and what `Track.segments` tells of them, (6, k, W)."""
    last = track.last[rows] - 1
    # minimum and maximum: np.clip costs five times as much.
    segment = np.minimum(np.maximum(index[:, None] + around, 0), last[:, None])
    # Taking from a flat array costs a third of indexing by row and segment.
    _, points, values = track.segments.shape
    row = np.arange(len(track.segments))[rows]
    window = track.segments.reshape(-1, values).take(row[:, None] * points + segment, axis=0)
    return segment, window.transpose(2, 0, 1)


def cross_gates(
    track: Track, before: Array, after: Array, s: Values, passed: Values, rows: Rows = ALL
) -> tuple[Values, Values]:
    """Which cars passed their next gate in this tick, and which missed one.

    Args:
        track: the gates.
        before: (n, 2) rear axle a tick ago, m.
        after: (n, 2) rear axle now, m.
        s: (n,) place on the route, m, or the number of a car alone.
        passed: (n,) gates passed so far, or a number.
        rows: all cars.

    Returns:
        (n,) passed the next gate: crossed its plane forwards between the posts;
        (n,) missed a gate: crossed a plane outside the posts, or backwards; bools of a car alone.
    """
    has_gates = track.gate_s.shape[1] > 0
    if not has_gates or not np.count_nonzero(beside := np.abs(spread(s) - track.gate_s[rows]) < GATE_ROUTE_REACH_M):
        return (False, False) if rows is ALONE else (np.zeros(len(s), bool), np.zeros(len(s), bool))
    x0, y0 = _gate_frame(track, before, rows)
    x1, y1 = _gate_frame(track, after, rows)
    share = np.where(x1 != x0, -x0 / np.where(x1 != x0, x1 - x0, 1.0), 0.0)
    offset = np.abs(y0 + share * (y1 - y0))
    near = beside & (offset < GATE_REACH_M)
    between = offset < track.gate_width[rows] / 2
    forwards = near & (x0 < 0) & (x1 >= 0)
    backwards = near & (x0 >= 0) & (x1 < 0)
    is_next = np.arange(track.gate_s.shape[1]) == spread(passed)
    through = (forwards & between & is_next).any(axis=-1)
    missed = (forwards & ~(between & is_next)).any(axis=-1) | (backwards & between).any(axis=-1)
    return plain(through), plain(missed)


def _gate_frame(track: Track, position: Array, rows: Rows) -> tuple[Array, Array]:
    """x and y of the cars as seen from each gate, (n, G) m."""
    pose, unit = track.gate_pose[rows], track.gate_unit[rows]
    x, y = columns(position, rows)
    return rotate_back(unit[..., 0], unit[..., 1], spread(x) - pose[..., 0], spread(y) - pose[..., 1])


def wall_clearance(track: Track, pose: Array, car: CarConfig, rows: Rows = ALL) -> tuple[Values, Values]:
    """True distance from the side ultrasonics to the walls beside plain straight stretches, square to the walls.

    Args:
        track: the stretches.
        pose: (n, 3) x, y [m], yaw [rad].
        car: where the ultrasonics stand.
        rows: all cars.

    Returns:
        (n,) left, (n,) right, m; NaN where the car is on no such stretch, or turned by more than about 45 degrees.
        Numbers of a car alone.
    """
    if rows is ALONE:
        return _wall_clearance_alone(track, pose, car)
    place = columns(pose, rows)
    n, count, _ = track.straights.shape
    if count == 0:
        return np.full(n, np.nan), np.full(n, np.nan)
    place = tuple(values[:, None] for values in place)
    on, left, right = _clearances(
        place, track.straights.transpose(2, 0, 1), track.straight_unit.transpose(2, 0, 1), car
    )
    first = np.arange(n), on.argmax(axis=1)
    here = on[first]
    return np.where(here, left[first], np.nan), np.where(here, right[first], np.nan)


def _wall_clearance_alone(track: Track, pose: Array, car: CarConfig) -> tuple[float, float]:
    """As `wall_clearance`, for a car alone, stretch by stretch."""
    x, y, yaw = pose[ALONE].tolist()
    for straight, unit in zip(track.straights[ALONE].tolist(), track.straight_unit[ALONE].tolist(), strict=True):
        (x0, y0, _, length, _), (cos, sin) = straight, unit
        along, _ = rotate_back(cos, sin, x - x0, y - y0)
        # A car is on a stretch with its middle, which is between 0 and `middle_x` farther along than its rear axle.
        if -car.middle_x <= along <= length:
            is_on, left, right = _clearances((x, y, yaw), straight, unit, car)
            if is_on:
                return left, right
    return math.nan, math.nan


def _clearances(pose: Any, straight: Any, unit: Any, car: CarConfig) -> tuple[Values, Values, Values]:
    """Whether a car is on a stretch, and its clearances there, left and right, m; all numbers, or all arrays."""
    x0, y0, yaw, length, width = straight
    cos, sin = unit
    turn, half = pose[2] - yaw, width / 2
    cos_turn = plain(np.cos(turn))
    along, across = rotate_back(cos, sin, pose[0] - x0, pose[1] - y0)
    x, y = along + car.middle_x * cos_turn, across + car.middle_x * plain(np.sin(turn))
    on = (x >= 0) & (x <= length) & (abs(y) < half) & (cos_turn > 0.7)
    side = car.sonar_side * cos_turn
    return on, half - y - side, half + y - side


def time_limit(length: Array, config: TaskConfig) -> Array:
    """Time that a route of this length (n,) may take, (n,) s: length / `nominal_speed` + `grace_s`."""
    limit: Array = length / config.nominal_speed + config.grace_s
    return limit


@dataclass(kw_only=True, eq=False)
class Outcome:
    """What n cars did in a tick, each (n,), or the numbers of a car alone."""

    advance: Values
    """(n,) distance gained along the route, m."""
    gate: Values
    """(n,) the car passed its next gate."""
    success: Values
    """(n,) the car reached the goal."""
    failure: Values
    """(n,) the car touched something or missed a gate."""
    steering_change: Values
    """(n,) change of the steering command, -2 to 2."""


def progress_term(outcome: Outcome, config: TaskConfig) -> Values:
    """`progress_reward` for each metre gained along the route; less than 0 backwards."""
    return config.progress_reward * outcome.advance


def gate_term(outcome: Outcome, config: TaskConfig) -> Values:
    """`gate_reward` in the tick in which the car passes its next gate."""
    return outcome.gate * float(config.gate_reward)


def success_term(outcome: Outcome, config: TaskConfig) -> Values:
    """`success_reward` in the tick in which the car reaches the goal."""
    return outcome.success * float(config.success_reward)


def failure_term(outcome: Outcome, config: TaskConfig) -> Values:
    """`failure_reward` in the tick in which the car touches something or misses a gate."""
    return outcome.failure * float(config.failure_reward)


def steering_term(outcome: Outcome, config: TaskConfig) -> Values:
    """Minus `steering_cost` times the square of the steering command's change in the tick, 0 to 4."""
    change = outcome.steering_change
    return -(config.steering_cost * (change * change))


def time_term(outcome: Outcome, config: TaskConfig) -> Values:
    """Minus `time_cost` in every tick of 1/80 s."""
    cost = -float(config.time_cost)
    return np.full(len(outcome.advance), cost) if isinstance(outcome.advance, np.ndarray) else cost


REWARD_TERMS: Mapping[str, Callable[[Outcome, TaskConfig], Values]] = {
    "progress": progress_term,
    "gate": gate_term,
    "success": success_term,
    "failure": failure_term,
    "steering": steering_term,
    "time": time_term,
}
"""The terms of the reward by name, in the order in which `reward` adds them. Progress along the route is the potential
that a learner climbs (Ng et al., 1999); beside it all terms are small but those of the episode's end."""


def reward_terms(outcome: Outcome, config: TaskConfig) -> dict[str, Values]:
    """What a tick earns, term by term: name -> (n,)."""
    return {name: term(outcome, config) for name, term in REWARD_TERMS.items()}


def reward(terms: Mapping[str, Values]) -> Values:
    """What a tick earns, (n,): the terms added one after the other, so that the last bit is always the same."""
    return reduce(operator.add, terms.values())
