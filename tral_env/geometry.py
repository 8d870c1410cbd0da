"""The car's measures and its markers' sizes, once: plain numbers that anyone may import.

Frame: ground below the middle of the rear axle, x forward, y left, z up.

Sources, of all rooms: "report" is the TRAL report of 2016; "era" is what other groups measured on their cars in those
years; "ucboard" and "PSES" are the data sheet and the URDF that the Project Seminar Real-Time Systems at TU Darmstadt
published for the same cars; "echtzeitsysteme" is the repository slinshady89/echtzeitsysteme of a group of that seminar;
"choice" is a choice of this project.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

WHEELBASE_M = 0.258
"""Distance of the axles. Source: ucboard."""
TRACK_M = 0.155
"""Distance of the wheels of an axle. Source: ucboard."""
WHEEL_RADIUS_M = 0.032
"""Radius of each wheel. Source: PSES."""
FULL_LOCK_DEG = 22.0
"""Steering angle of the bicycle model at command 1: a turning radius of 0.64 m. Source: echtzeitsysteme."""
FULL_LOCK = math.radians(FULL_LOCK_DEG)
"""Steering angle of the bicycle model at command 1, rad."""
LENGTH_M = 0.40
"""Length of the car's outline. Source: PSES."""
WIDTH_M = 0.20
"""Width of the car's outline. Source: PSES."""
HEIGHT_M = 0.18
"""Height of the car's outline. Source: PSES."""

STEERING_PLAY = 0.3
"""While the car stands, the tyres' scrub holds the wheels up to this far from where the servo wants them, in units of
steering: 0.075 N m over the servo saver's 0.65 N m/rad, 6.6 deg of the 22. Source: choice, fits the fault in the
report."""
SCRUB_SPEED = 0.06
"""At this rolling speed the scrub has fallen to 71 %, m/s: a patch of 2 cm that turns at 3 rad/s. Source: choice."""

SIDE_SONAR_Y_M = 0.10
"""Each side ultrasonic stands this far from the middle line, midway between the axles. Source: ucboard."""
FRONT_SONAR_FROM_MIDDLE_M = 0.175
"""The front ultrasonic stands this far ahead of midway between the axles. Source: ucboard."""
SIDE_SONAR_X_M = WHEELBASE_M / 2
"""The side ultrasonics stand this far ahead of the rear axle."""
FRONT_SONAR_X_M = SIDE_SONAR_X_M + FRONT_SONAR_FROM_MIDDLE_M
"""The front ultrasonic stands this far ahead of the rear axle."""

MARKER_SIZE_M = 0.18
"""Edge of an ArUco marker's black square. Source: era."""
MARKER_BOARD_WIDTH_M = 0.24
"""Edge of a marker's board: a quiet zone of one module (0.03 m) on each side of the black square."""
MARKER_MODULES = 6
"""Cells along the edge of a marker's black square."""
MARKER_QUIET_MODULES = 1
"""White cells between the black square and the edge of its board."""

HALL_METRES_PER_TICK = 0.02513
"""The rim of the rear left wheel travels this far from one tick of the hall sensor to the next: 8 magnets, 2 pi 0.032
/ 8. Source: ucboard."""

STANDING_MPS = 0.05
"""Below this speed the car counts as standing, m/s. Source: choice, half of the hall sensor's slowest reading."""


def _second_power(value: float) -> float:
    """`value ** 2`, whose last bit is not always that of `value * value`."""
    power: float = value**2
    return power


def scrub_fall(
    speed: Any,
    scale: float = SCRUB_SPEED,
    *,
    sqrt: Callable[[Any], Any] = math.sqrt,
    square: Callable[[Any], Any] = _second_power,
) -> Any:
    """How many times smaller the scrub of the front tyres is than at standstill: ``sqrt(1 + (v / v0)^2)``.

    A tyre that turns about its kingpin at rate w slides in its patch of length a; rolling at v carries the twisted
    rubber out of the patch. The ratio s = a w / v (turn slip) decides: torque ``M0 s / sqrt(1 + s^2)``, full at
    standstill and vanishing when rolling. With w held at the rate of a usual correction, a w is the speed v0. So the
    angle that a weak servo reaches depends on speed, as the report of 2016 says.

    Args:
        speed: rolling speed v, m/s: a number, or an array of any shape.
        scale: v0, m/s.
        sqrt: `math.sqrt` for a number, `numpy.sqrt` for an array.
        square: for a car alone that is to round as an array of cars does, `tral_env.arrays.square`.
    """
    return sqrt(1.0 + square(speed / scale))


def steering_play(speed: float) -> float:
    """Play of the steering at a speed [m/s], in units of steering: the scrub over the servo saver and the full lock."""
    return STEERING_PLAY / float(scrub_fall(speed))


def curvature(steering: Any, *, tan: Callable[[Any], Any] = math.tan) -> Any:
    """Curvature [1/m], + = left, of the rear axle's path at a steering command: tan(lock s) / wheelbase.

    Args:
        steering: a number, or an array of any shape.
        tan: `math.tan` for a number, `numpy.tan` for an array.
    """
    return tan(FULL_LOCK * steering) / WHEELBASE_M


def steering_for(path_curvature: float) -> float:
    """Steering command for a curvature [1/m], not clipped: the inverse of `curvature`."""
    return math.atan(WHEELBASE_M * path_curvature) / FULL_LOCK
