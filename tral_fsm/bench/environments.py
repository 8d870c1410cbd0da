"""Environments as contestants: ours, Gymnasium's vector environments of ours, and well-known ones."""

from __future__ import annotations

from collections.abc import Callable
from itertools import cycle
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import tral_env
from tral_env.vector_processes import vector_env
from tral_fsm.bench.commands import gentle
from tral_fsm.bench.timing import Contestant

ENV_ID = f"{tral_env.__name__}:TralCorridor-v0"
_COMMANDS = 2000
"""Number of commands after which a single environment gets the first one again."""


def native(scenario: str, rows: int, threads: int, processes: int = 1) -> Contestant:
    """The native vector environment with its resets; each of its processes has so many threads."""
    env = vector_env(rows, processes=processes, autoreset_mode="SameStep", nthread=threads, scenario=scenario)
    env.reset(seed=0)
    rng = np.random.default_rng(0)

    def step() -> int:
        env.step(gentle(rows, rng))
        return rows

    name, kind = f"native vector env, {rows} rows, {threads} threads", "native"
    if processes > 1:
        name, kind = f"native vector env, {rows} rows, {processes} processes", "processes"
    return Contestant(
        name=name, kind=kind, rows=rows, threads=threads, has_workers=processes > 1, step=step, close=env.close
    )


def single(scenario: str) -> Contestant:
    """A single environment, reset when it ends."""
    env = gym.make(ENV_ID, scenario=scenario)
    rng = np.random.default_rng(0)
    # To draw them costs time, too, which is not the environment's.
    commands = cycle([gentle(1, rng)[0] for _ in range(_COMMANDS)])
    step = _until_it_ends(env, lambda: next(commands))
    return Contestant(name="single env", kind="single", step=step, close=env.close)


def landmark(name: str) -> Contestant:
    """A well-known environment.

    Raises:
        ImportError: a package that it needs is not installed.
    """
    env = gym.make(name)
    env.action_space.seed(0)
    step_s = float(env.get_wrapper_attr("dt"))
    step = _until_it_ends(env, env.action_space.sample)
    return Contestant(name=name, kind="landmark", step=step, step_s=step_s, close=env.close)


def _until_it_ends(env: gym.Env[Any, Any], command: Callable[[], Any]) -> Callable[[], int]:
    """A function that steps an environment once, and resets it when it ends."""
    env.reset(seed=0)

    def step() -> int:
        _, _, terminated, truncated, _ = env.step(command())
        if terminated or truncated:
            env.reset()
        return 1

    return step


def rival(scenario: str, rows: int, mode: str) -> Contestant:
    """Gymnasium's SyncVectorEnv or AsyncVectorEnv of the single environment."""
    env = gym.make_vec(ENV_ID, num_envs=rows, vectorization_mode=mode, scenario=scenario)
    rng = np.random.default_rng(0)
    step = counting(env, lambda: gentle(rows, rng))
    name = f"{mode}, {rows} environments"
    return Contestant(name=name, kind=mode, rows=rows, has_workers=mode == "async", step=step, close=env.close)


def counting(env: gym.vector.VectorEnv[Any, Any, Any], commands: Callable[[], Any]) -> Callable[[], int]:
    """A function that steps a vector environment with next-step autoreset, and counts the rows that drove.

    Args:
        env: the environment; it is reset.
        commands: gives the commands of each step.

    Returns:
        The function; a row whose episode ended in the step before only resets, and does not count.
    """
    env.reset(seed=0)
    waiting: NDArray[np.bool_] = np.zeros(env.num_envs, bool)

    def step() -> int:
        nonlocal waiting
        _, _, terminated, truncated, _ = env.step(commands())
        counted = env.num_envs - int(waiting.sum())
        waiting = terminated | truncated
        return counted

    return step
