"""Steps per second of several environments, side by side in one run.

A step is one control period of 12.5 ms of one car. Contestants take turns, round by round, so that a computer that
slows down slows them all; each figure is the median over the rounds. The warm-up lies outside the clock, and a step in
which an environment only resets does not count.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
from numpy.typing import NDArray

import tral_env
from tral_env.config import CameraConfig
from tral_env.course.layout import Course
from tral_env.course.scene import Pool, build_model
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.simulation.culling import LOCAL_BOXES
from tral_env.vector_env import TralCorridorVectorEnv
from tral_fsm.bench.host import host
from tral_fsm.bench.size import size_cost
from tral_fsm.bench.startup import startup_cost

ENV_ID = f"{tral_env.__name__}:TralCorridor-v0"
_VEL = int(mujoco.mjtStage.mjSTAGE_VEL)


@dataclass(frozen=True, kw_only=True)
class SpeedPlan:
    """What to measure, and for how long."""

    scenario: str = "corners"
    """Family of the courses."""
    rows: tuple[int, ...] = (1, 16, 64, 256, 1024)
    """Numbers of rows of the native vector environment."""
    threads: tuple[int, ...] = (1, 2)
    rivals: int = 16
    """Number of environments in Gymnasium's own vector environments."""
    landmarks: tuple[str, ...] = ("Ant-v5", "HalfCheetah-v5")
    """Well-known environments, whose steps have their own length."""
    rounds: int = 3
    seconds: float = 1.0
    """Time of a contestant in a round, s."""
    camera: bool = True
    """Whether to measure the rendered camera too."""
    sizes: bool = True
    """Whether to measure the cost of larger courses too."""


QUICK = SpeedPlan(rows=(1, 256), threads=(2,), landmarks=("HalfCheetah-v5",), rounds=2, seconds=0.6, sizes=False)
"""A plan of less than a minute."""


@dataclass(kw_only=True)
class Contestant:
    """An environment or a bare loop whose steps are counted."""

    name: str
    step: Callable[[], int]
    """Function that steps once, and returns the number of steps that count."""
    step_s: float = CONTROL_PERIOD_S
    """Simulated time of a step, s."""
    close: Callable[[], None] = lambda: None
    wall: list[float] = field(default_factory=list)
    """Steps per second of wall time, in each round."""
    cpu: list[float] = field(default_factory=list)
    """Steps per second of this process's CPU time, in each round."""

    def run(self, seconds: float) -> None:
        """Run one round."""
        steps, wall, cpu = 0, time.perf_counter(), time.process_time()
        while time.perf_counter() - wall < seconds:
            steps += self.step()
        self.wall.append(steps / (time.perf_counter() - wall))
        self.cpu.append(steps / max(time.process_time() - cpu, 1e-9))

    def record(self) -> dict[str, float | str]:
        """Medians: steps per second; simulated seconds per second of wall time, and of this process's CPU time."""
        wall, cpu = statistics.median(self.wall), statistics.median(self.cpu)
        return {
            "name": self.name,
            "steps_per_s": wall,
            "sim_s_per_wall_s": wall * self.step_s,
            "sim_s_per_cpu_s": cpu * self.step_s,
        }


def commands(n: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Gentle random commands, (n, 2): the cars drive, and crash now and then."""
    return np.stack([rng.uniform(-0.3, 0.3, n), rng.uniform(0.25, 0.5, n)], axis=1).astype(np.float32)


def native(scenario: str, rows: int, threads: int) -> Contestant:
    """The native vector environment with its resets."""
    env = TralCorridorVectorEnv(rows, autoreset_mode="SameStep", nthread=threads, scenario=scenario)
    env.reset(seed=0)
    rng = np.random.default_rng(0)

    def step() -> int:
        env.step(commands(rows, rng))
        return rows

    return Contestant(name=f"native vector env, {rows} rows, {threads} threads", step=step, close=env.close)


RECORDED_TICKS = 160
"""Number of recorded ticks, 2 s: the cars have reached their speed, and few of them a wall."""


@lru_cache(maxsize=8)
def recording(scenario: str, rows: int) -> list[dict[str, NDArray[np.float64]]]:
    """Arrays that the native environment writes into its batch in each of its first ticks."""
    env = TralCorridorVectorEnv(rows, scenario=scenario)
    env.reset(seed=0)
    rng, batch = np.random.default_rng(0), env.world.sim.batch
    ctrl, loss = batch.bind("ctrl"), batch.expand("dof_frictionloss")
    ticks = []
    for _ in range(RECORDED_TICKS):
        env.step(commands(rows, rng))
        ticks.append({"ctrl": ctrl.copy(), "loss": loss.copy()})
    env.close()
    return ticks


def bare_batch(scenario: str, rows: int, threads: int) -> Contestant:
    """`Batch.step` through the same drives as the native environment, without readings, rewards and resets."""
    ticks = recording(scenario, rows)
    env = TralCorridorVectorEnv(rows, nthread=threads, scenario=scenario)
    env.reset(seed=0)
    batch, substeps = env.world.sim.batch, env.world.sim.substeps
    start, ctrl, loss = batch.state.copy(), batch.bind("ctrl"), batch.expand("dof_frictionloss")
    tick = 0

    def step() -> int:
        nonlocal tick
        if tick % len(ticks) == 0:
            batch.state[:] = start
        ctrl[:], loss[:] = ticks[tick % len(ticks)]["ctrl"], ticks[tick % len(ticks)]["loss"]
        batch.step(nstep=substeps, stage=_VEL)
        tick += 1
        return rows

    return Contestant(name=f"bare Batch.step, {rows} rows, {threads} threads", step=step, close=env.close)


def bare_loop(scenario: str) -> Contestant:
    """`mj_step` of the same model in a loop."""
    model = build_model(Pool(min(Pool.for_scenario(scenario).boxes, LOCAL_BOXES)), looks=False)
    data = mujoco.MjData(model)
    substeps = round(CONTROL_PERIOD_S / model.opt.timestep)
    ctrl = np.array([0.05, 2.5])

    def step() -> int:
        data.ctrl[:] = ctrl
        mujoco.mj_step(model, data, substeps)
        return 1

    return Contestant(name="bare mj_step loop", step=step)


def single(env_id: str, name: str, step_s: float = CONTROL_PERIOD_S, **arguments: Any) -> Contestant:
    """A single environment, reset when it ends."""
    env = gym.make(env_id, **arguments)
    env.reset(seed=0)
    env.action_space.seed(0)
    rng = np.random.default_rng(0)
    own = env_id == ENV_ID

    def step() -> int:
        action = commands(1, rng)[0] if own else env.action_space.sample()
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()
        return 1

    return Contestant(name=name, step=step, step_s=step_s, close=env.close)


def rival(scenario: str, rows: int, mode: str) -> Contestant:
    """Gymnasium's SyncVectorEnv or AsyncVectorEnv of the single environment."""
    env = gym.make_vec(ENV_ID, num_envs=rows, vectorization_mode=mode, scenario=scenario)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    waiting = np.zeros(rows, bool)

    def step() -> int:
        nonlocal waiting
        _, _, terminated, truncated, _ = env.step(commands(rows, rng))
        counted = rows - int(waiting.sum())
        waiting = terminated | truncated
        return counted

    return Contestant(name=f"{mode}, {rows} environments", step=step, close=env.close)


def contestants(plan: SpeedPlan) -> Iterator[Contestant]:
    """All contestants."""
    yield bare_loop(plan.scenario)
    yield single(ENV_ID, "single env", scenario=plan.scenario)
    yield rival(plan.scenario, plan.rivals, "sync")
    yield rival(plan.scenario, plan.rivals, "async")
    for rows in plan.rows:
        for threads in plan.threads:
            if rows == 1 and threads > 1 and len(plan.threads) > 1:
                continue
            yield native(plan.scenario, rows, threads)
            yield bare_batch(plan.scenario, rows, threads)
    for name in plan.landmarks:
        try:
            landmark = gym.make(name)
        except ImportError:  # the MuJoCo environments of Gymnasium need imageio
            continue
        step_s = float(landmark.get_wrapper_attr("dt"))
        landmark.close()
        yield single(name, name, step_s)


def measure(plan: SpeedPlan, on_round: Callable[[str], None] = lambda name: None) -> dict[str, Any]:
    """Measure all contestants.

    Args:
        plan: what to measure, and for how long.
        on_round: called with the name of each contestant when its turn comes.

    Returns:
        ``host``, ``plan``; ``contestants`` with their records; ``ratios`` by name; ``reset_ms_per_row`` with a new
        course of the family ``reset_scenario``, ``reset_ms_per_row_kept`` with a kept one; ``startup``, ``camera``,
        ``course_size``.
    """
    field_ = list(contestants(plan))
    for contestant in field_:
        contestant.run(plan.seconds / 4)
        contestant.wall.clear()
        contestant.cpu.clear()
    for _ in range(plan.rounds):
        for contestant in field_:
            on_round(contestant.name)
            contestant.run(plan.seconds)
    for contestant in field_:
        contestant.close()
    return {
        "host": host(),
        "plan": asdict(plan),
        "contestants": [contestant.record() for contestant in field_],
        "ratios": ratios(field_),
        "reset_scenario": plan.scenario,
        "reset_ms_per_row": reset_cost(plan.scenario),
        "reset_ms_per_row_kept": reset_cost(plan.scenario, courses=KEPT),
        "startup": startup_cost(plan.scenario),
        "camera": camera_cost() if plan.camera else None,
        "course_size": size_cost() if plan.sizes else None,
    }


def ratios(field_: list[Contestant]) -> dict[str, float]:
    """Medians of the ratios of two contestants, round by round."""
    by_name = {contestant.name: contestant for contestant in field_}

    def ratio(one: str, other: str) -> float | None:
        if one not in by_name or other not in by_name:
            return None
        pairs = zip(by_name[one].wall, by_name[other].wall, strict=True)
        return statistics.median(a / b for a, b in pairs)

    big = "native vector env, 256 rows, 2 threads"
    names = {
        "single_over_bare_loop": ("single env", "bare mj_step loop"),
        "vector_over_bare_batch": (big, "bare Batch.step, 256 rows, 2 threads"),
        "vector_over_sync": (big, next((n for n in by_name if n.startswith("sync")), "")),
        "vector_over_async": (big, next((n for n in by_name if n.startswith("async")), "")),
        "rows_1024_over_64": ("native vector env, 1024 rows, 2 threads", "native vector env, 64 rows, 2 threads"),
    }
    found = {name: ratio(*pair) for name, pair in names.items()}
    return {name: value for name, value in found.items() if value is not None}


KEPT = 8
"""Number of kept courses in the timing of resets. Source: choice; their number does not matter once they are built."""


def reset_cost(scenario: str, rows: int = 64, courses: int | None = None) -> float:
    """Time to reset a row with a new car, ms, amortized over `rows`.

    Args:
        scenario: family of the courses.
        rows: number of cars that are reset together.
        courses: number of kept courses; None: each reset builds a course.
    """
    env = TralCorridorVectorEnv(rows, scenario=scenario, courses=courses)
    env.reset(seed=0)
    while courses is not None and len(env.world.kept) < courses:
        env.reset()
    times = []
    for _ in range(5):
        start = time.perf_counter()
        env.reset()
        times.append((time.perf_counter() - start) / rows * 1e3)
    env.close()
    return statistics.median(times)


_ONE_GATE = {"name": "gate", "segments": [{"length": 8.0, "width": 2.4, "gates": [{"id": 0, "at": 4.0}]}]}
"""A course with one gate; the car starts at 1 m and sees both markers."""


def camera_cost(frames: int = 20) -> dict[str, float] | str:
    """Time of a frame with a gate in the environment, and of rendering, detection and pose alone, ms."""
    from tral_env.env import TralCorridorEnv
    from tral_env.errors import RenderError
    from tral_env.perception.aruco import Detector, marker_poses

    env = TralCorridorEnv(course=Course.model_validate(_ONE_GATE), camera="rendered")
    try:
        env.reset(seed=0)
    except RenderError as error:
        return str(error)
    sim = env.world.sim
    pose, qpos, mounting, row = sim.pose, sim.qpos, np.zeros((1, 3)), np.zeros(1, np.int64)
    detector = Detector()
    image = env.render_view("onboard", 640, 480)
    markers, camera = detector.detect(image), CameraConfig()
    contestants: dict[str, Callable[[], object]] = {
        "in_env_ms": lambda: sim.vision.see(row, pose, qpos, mounting),
        "bare_render_ms": lambda: env.render_view("onboard", 640, 480),
        "bare_detect_ms": lambda: detector.detect(image),
        "bare_pose_ms": lambda: marker_poses(markers, camera),
    }
    out = {}
    for name, act in contestants.items():
        times = []
        for _ in range(frames):
            start = time.perf_counter()
            act()
            times.append((time.perf_counter() - start) * 1e3)
        out[name] = statistics.median(times)
    env.close()
    return out
