"""Costs beside the step: a reset, a frame of the rendered camera, and larger courses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.utils import seeding

from tral_env.config import CameraConfig
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, Door, Segment
from tral_env.env import TralCorridorEnv
from tral_env.options import CorridorConfig
from tral_env.perception.aruco import Detector, marker_poses
from tral_env.perception.degrade import degrade
from tral_env.simulation.vision import Webcam
from tral_env.vector_env import TralCorridorVectorEnv
from tral_env.world import World
from tral_fsm.bench.bare import bare_step
from tral_fsm.bench.timing import Contestant, take_turns

KEPT = 8
"""Number of kept courses in the timing of resets. Source: choice; their number does not matter once they are built."""
DOORS = (0, 4, 49)
"""Numbers of doors on each side of a straight corridor, 2.5 m apart: 4, 36 and about 400 boxes."""
_UNDER_WAY_TICKS = 20
"""Ticks after which the cars of a bare batch drive; their commands stay."""
_ONE_GATE = {"name": "gate", "segments": [{"length": 8.0, "width": 2.4, "gates": [{"id": 0, "at": 4.0}]}]}
"""A course with one gate; the car starts at 1 m and sees both markers."""


def reset_cost(scenario: str, *, rows: int = 64, rounds: int = 5, seconds: float = 0.05) -> dict[str, float]:
    """Time to reset a row with a new car, ms, amortized over `rows`.

    Args:
        scenario: family of the courses.
        rows: number of cars that are reset together.
        rounds: number of turns of each contestant.
        seconds: time of a turn, s; at least one reset.

    Returns:
        ``new``: each reset builds a course; ``kept``: it takes one of `KEPT` courses that are built already.
    """
    field = [_resets("new", scenario, rows, None), _resets("kept", scenario, rows, KEPT)]
    take_turns(field, rounds=rounds, seconds=seconds)
    return {contestant.name: 1e3 * contestant.seconds_per_step for contestant in field}


def _resets(name: str, scenario: str, rows: int, courses: int | None) -> Contestant:
    env = TralCorridorVectorEnv(rows, scenario=scenario, courses=courses)
    env.reset(seed=0)
    while courses is not None and len(env.world.kept) < courses:
        env.reset()

    def step() -> int:
        env.reset()
        return rows

    return Contestant(name=name, step=step, close=env.close)


def camera_cost(*, rounds: int = 5, seconds: float = 0.05) -> dict[str, float]:
    """Time of a frame with a gate in the environment, and of rendering, detection and pose alone, ms.

    The rendered image has no faults. The faults of the default level, and the search in an image with these, are
    parts of their own.

    Args:
        rounds: number of turns of each contestant.
        seconds: time of a turn, s; at least one frame.

    Raises:
        RenderError: this computer has no OpenGL.
    """
    env = TralCorridorEnv(course=Course.model_validate(_ONE_GATE), camera="rendered")
    env.reset(seed=0)
    sim = env.world.sim
    pose, qpos, mounting, row = sim.pose, sim.physics.qpos, np.zeros((1, 3)), np.zeros(1, np.int64)
    detector, camera = Detector(), CameraConfig()
    webcam = Webcam(1, sim.pool, camera)
    webcam.place(0, sim.plan(0), degradation=0.0, seed=0)
    clean, rng = webcam.image(0, qpos[0], mounting[0]), np.random.default_rng(0)
    level = float(sim.car_parameters.drawn["image_degradation"][0])
    image = degrade(clean, level, rng)
    markers = detector.detect(image)
    acts: dict[str, Callable[[], object]] = {
        "in_env_ms": lambda: sim.cameras.vision.see(row, pose, qpos, mounting),
        "bare_render_ms": lambda: webcam.image(0, qpos[0], mounting[0]),
        "faults_ms": lambda: degrade(clean, level, rng),
        "bare_detect_ms": lambda: detector.detect(image),
        "bare_pose_ms": lambda: marker_poses(markers, camera),
    }
    field = [Contestant(name=name, step=_once(act)) for name, act in acts.items()]
    take_turns(field, rounds=rounds, seconds=seconds)
    webcam.close()
    env.close()
    return {contestant.name: 1e3 * contestant.seconds_per_step for contestant in field}


def _once(act: Callable[[], object]) -> Callable[[], int]:
    def step() -> int:
        act()
        return 1

    return step


def corridor(doors: int) -> Course:
    """A straight corridor with a number of doors on each side."""
    placed = tuple(Door(side=side, at=4.0 + 2.5 * i) for i in range(doors) for side in ("left", "right"))
    return Course(name=f"{doors} doors", segments=(Segment(length=max(20.0, 8.0 + 2.5 * doors), doors=placed),))


def size_cost(*, rows: int = 64, rounds: int = 3, seconds: float = 0.1) -> list[dict[str, Any]]:
    """Cost of a step over the number of boxes, on one thread.

    Args:
        rows: number of cars.
        rounds: number of turns of each contestant; in each the cars start anew.
        seconds: time of a turn, s.

    Returns:
        For each course ``boxes``, and the time of a control step of a car, us: ``step_us`` in the corridor,
        ``bare_us`` of `Batch.step` alone.
    """
    pairs = [(_driving(course, rows), _bare(course, rows)) for course in map(corridor, DOORS)]
    take_turns([contestant for pair in pairs for contestant in pair], rounds=rounds, seconds=seconds)
    return [
        {
            "boxes": len(build_plan(corridor(doors)).box_kind),
            "step_us": 1e6 * driving.seconds_per_step,
            "bare_us": 1e6 * bare.seconds_per_step,
        }
        for doors, (driving, bare) in zip(DOORS, pairs, strict=True)
    ]


def _driving(course: Course, rows: int) -> Contestant:
    world, command = World(rows, CorridorConfig(course=course)), np.tile([0.0, 0.4], (rows, 1))

    def step() -> int:
        world.step(command)
        return rows

    return Contestant(name=course.name, step=step, begin=lambda: start_rows(world), close=world.close)


def _bare(course: Course, rows: int) -> Contestant:
    world, command = World(rows, CorridorConfig(course=course)), np.tile([0.0, 0.4], (rows, 1))

    def begin() -> None:
        start_rows(world)
        for _ in range(_UNDER_WAY_TICKS):
            world.step(command)

    def step() -> int:
        bare_step(world.sim)
        return rows

    return Contestant(name=f"bare, {course.name}", step=step, begin=begin, close=world.close)


def start_rows(world: World) -> None:
    """Put all cars at the start of new courses; row k has the seed k."""
    world.reset(world.request(np.arange(world.n)), [seeding.np_random(row)[0] for row in range(world.n)])
