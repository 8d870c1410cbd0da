"""A sweep over the gains of a machine's wall-following states: what clearance error does each pair earn?"""

from __future__ import annotations

import contextlib
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from pydantic import ValidationError

from tral_env.errors import ConfigError
from tral_fsm.definition import MachineDefinition, WallSpec
from tral_fsm.policy import MachinePolicy
from tral_fsm.report.summary import Summary, summarize
from tral_fsm.rollout import drive


@dataclass(frozen=True, kw_only=True)
class Task:
    """On what the gains are tried."""

    scenario: str
    seeds: tuple[int, ...]
    randomization: str = "default"
    camera: str = "projected"


@dataclass(frozen=True, kw_only=True)
class Cell:
    """What one pair of gains earned."""

    p: float
    """Steering per m."""
    d: float
    """Steering per m/s."""
    summary: Summary

    def record(self) -> dict[str, Any]:
        """The cell as a dictionary."""
        return asdict(self)


def gains(machine: MachineDefinition) -> tuple[float, float]:
    """Gains p and d of the first wall-following state of a machine.

    Raises:
        ConfigError: it has none.
    """
    for state in machine.states:
        if isinstance(state, WallSpec):
            return state.p, state.d
    raise ConfigError(f"machine '{machine.name}' has no state that follows a wall, so it has no gains p and d")


def with_gains(machine: MachineDefinition, p: float, d: float) -> MachineDefinition:
    """The machine with these gains in all its wall-following states; machines inside it keep theirs.

    Args:
        machine: the machine.
        p: steering per m.
        d: steering per m/s.

    Raises:
        ConfigError: a gain is out of its range.
    """
    try:
        states = tuple(
            type(state).model_validate({**state.model_dump(), "p": p, "d": d}) if isinstance(state, WallSpec) else state
            for state in machine.states
        )
    except ValidationError as error:
        faults = "; ".join(f"{fault['loc'][0]}: {fault['msg']}" for fault in error.errors())
        raise ConfigError(f"gains p = {p:g}, d = {d:g} cannot be used: {faults}") from error
    return machine.model_copy(update={"states": states})


def sweep(
    machine: MachineDefinition,
    p: Sequence[float],
    d: Sequence[float],
    task: Task,
    *,
    processes: int = 1,
    on_cell: Callable[[Cell], None] | None = None,
) -> list[Cell]:
    """Drive the same courses with every pair of gains.

    Args:
        machine: whose gains are tried.
        p: values of p.
        d: values of d.
        task: on what they are tried.
        processes: how many work; the result does not depend on it.
        on_cell: called as each pair is done, in order.

    Returns:
        A cell for each pair, p slowest.
    """
    pairs = [(float(a), float(b)) for a in p for b in d]
    cells = []
    with _mapper(processes) as mapper:
        for cell in mapper(partial(_try, machine, task), pairs):
            cells.append(cell)
            if on_cell is not None:
                on_cell(cell)
    return cells


def best(cells: Sequence[Cell]) -> Cell:
    """The cell with the smallest clearance error among those with the most successes."""
    most = max(cell.summary.successes for cell in cells)

    def error(cell: Cell) -> float:
        rmse = cell.summary.clearance_rmse_m
        return np.inf if rmse is None else rmse

    return min((cell for cell in cells if cell.summary.successes == most), key=error)


@contextlib.contextmanager
def _mapper(processes: int) -> Iterator[Callable[..., Any]]:
    if processes == 1:
        yield map
        return
    # Threads and OpenGL contexts do not survive a fork.
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        yield pool.map


def _try(machine: MachineDefinition, task: Task, pair: tuple[float, float]) -> Cell:
    p, d = pair
    policy = MachinePolicy(with_gains(machine, p, d))
    env = gym.make(
        "tral_env:TralCorridor-v0", scenario=task.scenario, camera=task.camera, randomization=task.randomization
    )
    with contextlib.closing(env):
        records = [drive(env, policy, seed, scenario=task.scenario).record() for seed in task.seeds]
    return Cell(p=p, d=d, summary=summarize(records))
