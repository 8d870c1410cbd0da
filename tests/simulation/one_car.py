"""One car on a straight course, at the start of a drive, with the parts of its simulation at hand."""

import math

import numpy as np

from tral_env.course.layout import Course, Gate, Segment
from tral_env.options import CorridorConfig
from tral_env.simulation.sim import Simulation
from tral_env.world import World

ROW = np.zeros(1, np.int64)
WIDTH = 2.0
CORRIDOR = Course(name="corridor", segments=(Segment(length=12.0, width=WIDTH),))
GATE_AHEAD = Course(name="gate", segments=(Segment(length=12.0, width=WIDTH, gates=(Gate(id=2, at=5.0, width=0.8),)),))


def one_car(course: Course = CORRIDOR, **car: float) -> Simulation:
    """The simulation of a car without scatter, but for the parameters that are given."""
    world = World(1, CorridorConfig(course=course, randomization="none"))
    world.reset(world.request(ROW, {"car": car}), [np.random.default_rng(0)])
    return world.sim


def drive(sim: Simulation, steering: float, throttle: float, ticks: int) -> None:
    for _ in range(ticks):
        sim.step(np.array([[steering, throttle]]))


def put(sim: Simulation, x: float, y: float, yaw: float = 0.0) -> None:
    """Put the car at a place of the course, m and rad."""
    root = sim.physics.handles.root_qpos
    sim.physics.qpos[0, root : root + 2] = x, y
    sim.physics.qpos[0, root + 3], sim.physics.qpos[0, root + 6] = math.cos(yaw / 2), math.sin(yaw / 2)
