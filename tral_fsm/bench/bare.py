"""MuJoCo alone: what a step costs without readings, rewards and resets."""

from __future__ import annotations

from functools import lru_cache
from itertools import cycle

import mujoco
import numpy as np
from numpy.typing import NDArray

from tral_env.course.scene import Pool, build_model
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.simulation.culling import LOCAL_BOXES
from tral_env.simulation.sim import Simulation
from tral_env.vector_env import TralCorridorVectorEnv
from tral_fsm.bench.commands import gentle
from tral_fsm.bench.timing import Contestant

_VEL = int(mujoco.mjtStage.mjSTAGE_VEL)
RECORDED_TICKS = 160
"""Number of recorded ticks, 2 s: the cars have reached their speed, and few of them a wall."""


def bare_step(sim: Simulation) -> None:
    """Step the physics of all cars for one control period."""
    sim.physics.batch.step(nstep=sim.physics.substeps, stage=_VEL)


@lru_cache(maxsize=8)
def recording(scenario: str, rows: int) -> list[dict[str, NDArray[np.float64]]]:
    """Arrays that the native environment writes into its batch in each of its first ticks."""
    env = TralCorridorVectorEnv(rows, scenario=scenario)
    env.reset(seed=0)
    rng, batch = np.random.default_rng(0), env.world.sim.physics.batch
    ctrl, loss = batch.bind("ctrl"), batch.expand("dof_frictionloss")
    ticks = []
    for _ in range(RECORDED_TICKS):
        env.step(gentle(rows, rng))
        ticks.append({"ctrl": ctrl.copy(), "loss": loss.copy()})
    env.close()
    return ticks


def bare_batch(scenario: str, rows: int, threads: int) -> Contestant:
    """`Batch.step` through the same drives as the native environment."""
    ticks = cycle(enumerate(recording(scenario, rows)))
    env = TralCorridorVectorEnv(rows, nthread=threads, scenario=scenario)
    env.reset(seed=0)
    sim, batch = env.world.sim, env.world.sim.physics.batch
    start, ctrl, loss = batch.state.copy(), batch.bind("ctrl"), batch.expand("dof_frictionloss")

    def step() -> int:
        number, now = next(ticks)
        if number == 0:
            batch.state[:] = start
        ctrl[:], loss[:] = now["ctrl"], now["loss"]
        bare_step(sim)
        return rows

    name = f"bare Batch.step, {rows} rows, {threads} threads"
    return Contestant(name=name, kind="bare batch", rows=rows, threads=threads, step=step, close=env.close)


def bare_drive(scenario: str) -> Contestant:
    """`mj_step` in a loop, through the drive of one car of the native environment."""
    ticks = cycle(enumerate(recording(scenario, 1)))
    env = TralCorridorVectorEnv(1, scenario=scenario)
    env.reset(seed=0)
    physics = env.world.sim.physics
    model, start = physics.batch.get_model(0), physics.batch.state[0].copy()
    data = mujoco.MjData(model)
    env.close()

    def step() -> int:
        number, now = next(ticks)
        if number == 0:
            mujoco.mj_setState(model, data, start, mujoco.mjtState.mjSTATE_INTEGRATION)
        data.ctrl[:], model.dof_frictionloss[:] = now["ctrl"][0], now["loss"][0]
        mujoco.mj_step(model, data, physics.substeps)
        return 1

    return Contestant(name="bare mj_step loop through the same drive", kind="bare drive", step=step)


def bare_loop(scenario: str) -> Contestant:
    """`mj_step` of the same model in a loop, with no wall near the car and nothing to do but to roll."""
    model = build_model(Pool(min(Pool.for_scenario(scenario).boxes, LOCAL_BOXES)), looks=False)
    data = mujoco.MjData(model)
    substeps = round(CONTROL_PERIOD_S / model.opt.timestep)
    ctrl = np.array([0.05, 2.5])

    def step() -> int:
        data.ctrl[:] = ctrl
        mujoco.mj_step(model, data, substeps)
        return 1

    return Contestant(name="bare mj_step loop", kind="bare loop", step=step)
