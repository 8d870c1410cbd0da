"""The readings that a machine sees, by name."""

from __future__ import annotations

from typing import NamedTuple

from tral_env.interface import CORE_LAYOUT


class Readings(NamedTuple):
    """One row of an observation. The fields and their units are those of `tral_env.interface.CORE_FIELDS`."""

    ultrasonic_left: float
    ultrasonic_front: float
    ultrasonic_right: float
    ultrasonic_left_age: float
    ultrasonic_front_age: float
    ultrasonic_right_age: float
    distance: float
    speed: float
    gate_id: float
    gate_x: float
    gate_y: float
    gate_heading: float
    gate_age: float
    marker_id: float
    marker_x: float
    marker_y: float
    marker_heading: float
    marker_age: float
    steering: float
    throttle: float


assert Readings._fields == CORE_LAYOUT.names, "Readings has the fields of CORE_LAYOUT, in their order"
