"""Where the car is, and how fast it meets a wall: velocities set by hand beside one wall."""

import math

import numpy as np
import pytest

from tral_env.course.layout import Course
from tral_env.geometry import LENGTH_M, WHEELBASE_M, WIDTH_M
from tral_env.options import CorridorConfig
from tral_env.world import World

FRONT_M = WHEELBASE_M / 2 + LENGTH_M / 2
"""From the rear axle to the nose."""
WIDTH = 2.0
COURSE = Course.model_validate({"name": "one wall", "segments": [{"length": 10.0, "width": WIDTH}]})


def meet(y: float, yaw: float, velocity: tuple[float, float], yaw_rate: float) -> tuple[bool, float]:
    """Put the car beside the left wall at y [m] of the course, with a velocity [m/s] and a yaw rate [rad/s]; step once.

    Returns:
        Whether it touches the wall, and its closing speed, m/s.
    """
    config = CorridorConfig.of({"course": COURSE, "randomization": "none"})
    world = World(1, config)
    row = np.zeros(1, np.int64)
    world.reset(world.request(row), [np.random.default_rng(0)])
    physics = world.sim.physics
    root, dof = physics.handles.root_qpos, physics.handles.root_dof
    x = physics.qpos[0, root]
    physics.qpos[0, root : root + 2] = x + 3.0, y
    physics.qpos[0, root + 3], physics.qpos[0, root + 6] = math.cos(yaw / 2), math.sin(yaw / 2)
    physics.qvel[0, dof : dof + 2] = velocity
    physics.qvel[0, dof + 5] = yaw_rate
    world.sim.truth.observe()
    world.sim.step(np.zeros((1, 2)))
    told = bool(world.sim.truth.collision[0]), float(world.sim.truth.closing_speed[0])
    world.close()
    return told


TOUCHING_Y = WIDTH / 2 - WIDTH_M / 2 + 0.002
"""Parallel to the wall, the side overlaps it by 2 mm."""


def test_straight_into_the_wall_it_is_the_speed() -> None:
    collision, speed = meet(WIDTH / 2 - FRONT_M + 0.002, math.pi / 2, (0.0, 0.7), 0.0)
    assert collision
    assert speed == pytest.approx(0.7, abs=0.02)


def test_a_nose_that_swings_into_the_wall_closes_in_though_the_axle_does_not() -> None:
    collision, speed = meet(TOUCHING_Y, 0.0, (1.0, 0.0), 1.57)
    assert collision
    assert speed == pytest.approx(1.57 * FRONT_M, rel=0.15)


def test_a_car_that_leaves_the_wall_does_not_close_in() -> None:
    collision, speed = meet(TOUCHING_Y + 0.01, 0.0, (0.0, -0.1), 0.0)
    assert collision
    assert speed == 0.0


def test_far_from_walls_there_is_neither() -> None:
    assert meet(0.0, 0.0, (1.0, 0.3), 0.5) == (False, 0.0)
