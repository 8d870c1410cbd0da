"""The control laws, one equation each, on plain floats: a machine is ticked 80 times a second, one row at a time.

Frame: x forward, y left, angles counter-clockwise; + steering = left. Metres, seconds, radians.
"""

from __future__ import annotations

import math

from tral_env import geometry
from tral_env.geometry import FULL_LOCK, WHEELBASE_M
from tral_env.se2 import clip

PID_S = 0.0125
"""Time of a tick in the controllers of 2016, s."""
PID_INVS = 80.0
"""1 / PID_S, Hz."""
MIN_DAMPED_MPS = 0.2
"""A slower car is damped as at this speed, m/s: the gain goes with 1 / v. Source: choice."""


def pid(p: float, i: float, d: float, error: float, error_sum: float, error_old: float) -> float:
    """The controller of 2016: y = p e + i esum PID_S + d (e - eold) PID_INVS.

    Args:
        p: steering per m.
        i: steering per m and second.
        d: steering per m/s.
        error: e, range minus wanted clearance now, m.
        error_sum: esum, sum of e over the ticks, m.
        error_old: eold, e of the tick before, m.

    Returns:
        y, steering towards the wall, not yet clipped.
    """
    return pid_rate(p, i, d, error, error_sum, (error - error_old) * PID_INVS)


def pid_rate(p: float, i: float, d: float, error: float, error_sum: float, rate: float) -> float:
    """The same law with the derivative taken elsewhere, over the sonar's own interval: y = p e + i esum PID_S + d e'.

    Args:
        p: steering per m.
        i: steering per m and second.
        d: steering per m/s.
        error: e, m.
        error_sum: sum of e over the ticks, m.
        rate: e', m/s.

    Returns:
        y, steering towards the wall, not yet clipped.
    """
    return p * error + i * error_sum * PID_S + d * rate


def damping(p: float, speed: float) -> float:
    """Gain d [s/m] of `lqr_damping` at a speed [m/s], at least that of `MIN_DAMPED_MPS`."""
    return lqr_damping(p, max(speed, MIN_DAMPED_MPS))


def lqr_damping(p: float, speed: float, wheelbase: float = WHEELBASE_M, lock: float = FULL_LOCK) -> float:
    """Gain d that damps a car along a wall by the ratio 0.707: ``d = sqrt(2 L p / lock) / v``.

    Args:
        p: gain of the deviation, 1/m.
        speed: v, m/s, above 0.
        wheelbase: L, m.
        lock: steering angle at command 1, rad.

    Returns:
        d, s/m.

    Source: LQR of the kinematic bicycle along a wall, y'' = (v^2 / L) delta, kd = sqrt(2 L kp) / v; p = kp / lock.
    """
    return math.sqrt(2.0 * wheelbase * p / lock) / speed


def ramp(start: float, target: float, distance: float, driven: float) -> float:
    """Clearance [m] that runs linearly from `start` to `target` while `distance` metres are driven, then stays."""
    if driven >= distance:
        return target
    return start + (target - start) * driven / distance


def clipped_steering_for(path_curvature: float) -> float:
    """Steering command in [-1, 1] for a curvature [1/m], + = left."""
    return clip(geometry.steering_for(path_curvature))


def pursuit(x: float, y: float) -> float:
    """Steering onto the circle through a point (x forward, y left) [m]: curvature 2 y / (x^2 + y^2)."""
    return clipped_steering_for(2.0 * y / max(x * x + y * y, 1e-6))


def curvature_onto(
    offset: float, heading: float, length: float, steepest: float = math.pi / 4.0, slope: float = 0.0
) -> float:
    """Curvature [1/m] onto a line without overshoot: -(offset / length^2 + 2 (sin(heading) - slope) / length).

    Args:
        offset: where the car is beside the line, + = left of it, m.
        heading: of the car against the direction from which `slope` counts, rad.
        length: in which an offset dies away by the factor e, m.
        steepest: angle at which the car drives against that direction at most, rad.
        slope: sine of the line's own angle against that direction, + = to the left.
    """
    steep = clip(offset / (2.0 * length) - slope, math.sin(steepest))
    return -2.0 / length * (steep + math.sin(heading))


def line(offset: float, heading: float, length: float, steepest: float = math.pi / 4.0, slope: float = 0.0) -> float:
    """Steering in [-1, 1] with the curvature of `curvature_onto`."""
    return clipped_steering_for(curvature_onto(offset, heading, length, steepest, slope))


def slowed(speed: float | None, slow_speed: float, slow_front: float | None, front: float) -> float | None:
    """Speed before something ahead: falls linearly from `slow_front` on, to `slow_speed` at half of it.

    Args:
        speed: speed of the free road, m/s; None: the throttle is open loop.
        slow_speed: m/s.
        slow_front: front range at which to begin, m; None: never.
        front: front range now, m.

    Returns:
        m/s; None where the speed stays as it is.
    """
    if slow_front is None or speed is None or front >= slow_front:
        return None
    share = max(2.0 * front / slow_front - 1.0, 0.0)
    slow = min(slow_speed, speed)
    return slow + (speed - slow) * share
