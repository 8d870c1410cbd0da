"""Recordings held against what might have been: the simulated car on the same commands, the answers of a policy."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from tral_env.errors import BadFileError, ConfigError
from tral_env.interface import CONTROL_PERIOD_S, NO_ECHO_M, Policy
from tral_env.recording.read import Recording
from tral_env.se2 import wrap
from tral_fsm.evaluation.episode import outcome as outcome_of
from tral_fsm.evaluation.policy_files import files_of_policy
from tral_fsm.evaluation.recording import COURSE
from tral_fsm.evaluation.replayed import QUANTITIES, Comparison, OpenLoop
from tral_fsm.runtime.policy import MachinePolicy

Array = NDArray[np.float64]


def simulated_env(recording: Recording, render: bool = False) -> gym.Env[Any, Any]:
    """The environment in which a recorded drive can be driven again."""
    told = recording.configuration.get("env", {})
    groups = tuple(told.get("groups", ()))
    options = {name: value for name, value in told.items() if name != "groups"}
    if recording.source == "car":
        options = {"randomization": "none"}
    return gym.make(
        "tral_env:TralCorridor-v0", groups=groups, render_mode="rgb_array" if render else None, **options
    )  # fmt: skip


def start_again(env: gym.Env[Any, Any], recording: Recording, course: str | None = None) -> NDArray[np.float32]:
    """Put the simulated car where the recorded drive began; gives its first observation.

    Args:
        env: what `simulated_env` gave.
        recording: the recording.
        course: name or path of the course that was driven; None: the one that the recording keeps.

    Raises:
        ConfigError: neither is there.
    """
    told = recording.configuration
    kept = recording.files.get(COURSE)
    if course is None and kept is None:
        raise ConfigError(f"{recording.path} keeps no course: say on which one the car drove: --course")
    options: dict[str, Any] = {"course": json.loads(kept) if course is None and kept is not None else course}
    if "car" in told:
        options["car"] = told["car"]
    observation, _ = env.reset(seed=int(told.get("seed", 0)), options=options)
    first: NDArray[np.float32] = observation
    return first


def commands_of(recording: Recording) -> Array:
    """(N, 2) a command for each tick from the first to the last: a tick that was dropped has that of the one before.

    Of a real car they are the commands as applied, where these are known.

    Raises:
        BadFileError: the recording has no tick.
    """
    if not len(recording.tick):
        raise BadFileError(f"{recording.path}: the recording has no tick")
    applied = recording.applied
    known = recording.source == "car" and bool(np.isfinite(applied).all())
    rows = np.searchsorted(recording.tick, np.arange(recording.tick[-1] + 1), "right") - 1
    commands: Array = (applied if known else recording.action)[np.maximum(rows, 0)]
    return commands


def against_simulation(
    recording: Recording, course: str | None = None, on_tick: Callable[[int], None] = lambda tick: None
) -> Comparison:
    """Drive the simulated car from the same start with the recorded commands.

    Args:
        recording: the recording; that of a simulated drive gives no residual at all.
        course: see `start_again`.
        on_tick: called after each tick with its number.

    Raises:
        ConfigError: see `start_again`.
        BadFileError: the recording has no tick.
    """
    commands = commands_of(recording)
    env = simulated_env(recording)
    try:
        layout, outcome = env.unwrapped.world.layout, ""  # type: ignore[attr-defined]
        observation = start_again(env, recording, course)
        told, yaws = [observation], [_yaw_of(env)]
        for tick, command in enumerate(commands):
            observation, _, terminated, truncated, info = env.step(command)
            on_tick(tick)
            told.append(observation)
            yaws.append(float(info["pose"][2]))
            if terminated or truncated:
                outcome = outcome_of(info)
                break
    finally:
        env.close()
    last = int(recording.tick[-1]) + 1
    simulated = _quantities(_padded(np.array(told), last), layout.names, _padded(np.array(yaws), last + 1))
    seen = {name: values[recording.tick] for name, values in simulated.items()}
    early = outcome if len(told) <= last else ""
    return Comparison(time_s=recording.time_s, recorded=measured(recording), simulated=seen, outcome=early)


def _yaw_of(env: gym.Env[Any, Any]) -> float:
    world: Any = env.unwrapped
    return float(world.world.sim.pose[0, 2])


def _padded(rows: Array, length: int) -> Array:
    """The first rows, and NaN behind them up to a length."""
    padded = np.full((length, *rows.shape[1:]), np.nan)
    padded[: min(len(rows), length)] = rows[:length]
    return padded


def _quantities(told: Array, names: tuple[str, ...], yaw: Array) -> dict[str, Array]:
    """The quantities from observations (T, d), and from yaws (T + 1,) at the start and after each tick, rad."""
    column = {name: told[:, names.index(name)].astype(float) for name in QUANTITIES if name in names}
    values = {name: np.where(part < NO_ECHO_M, part, np.nan) for name, part in column.items() if name != "speed"}
    return {**values, "speed": column["speed"], "yaw_rate": wrap(np.diff(yaw)) / CONTROL_PERIOD_S}


def measured(recording: Recording) -> dict[str, Array]:
    """The quantities of a recording; the yaw rate is the true one, or that of a gyro, or NaN."""
    names = recording.layout.names
    yaw = np.array([truth.get("yaw_rad", math.nan) for truth in recording.truth])
    # Where a tick was dropped the rate between its neighbours is unknown.
    before = np.concatenate([[math.nan], np.where(np.diff(recording.tick) == 1, yaw[:-1], math.nan)])
    values = _quantities(recording.observation.astype(float), names, np.full(len(yaw) + 1, np.nan))
    values["yaw_rate"] = wrap(yaw - before) / CONTROL_PERIOD_S
    if np.isnan(yaw).all() and "imu_gyro_z" in names:
        values["yaw_rate"] = recording.observation[:, names.index("imu_gyro_z")].astype(float)
    return values


def open_loop(recording: Recording, policy: Policy, source: str = "") -> OpenLoop:
    """Let a policy answer each recorded observation; nothing obeys it.

    A machine other than the one that drove shadows: its answers are those from its estimate here and now, because the
    car did not do what it said (`MachinePolicy.shadow`). The machine that drove answers what it answered then.

    Args:
        recording: the recording.
        policy: the policy, for one car.
        source: its name or path.

    Raises:
        BadFileError: the recording has no tick.
        ConfigError: the policy cannot take the observations.
    """
    if not len(recording.tick):
        raise BadFileError(f"{recording.path}: the recording has no tick")
    files = files_of_policy(source, policy)
    drove = bool(files) and all(recording.files.get(name) == data for name, data in files.items())
    policy.reset(1)
    if isinstance(policy, MachinePolicy) and not drove:
        policy.shadow(np.array([True]))
    actions, states = [], []
    for row in recording.observation:
        actions.append(np.asarray(policy.act(row.copy()), float))
        told = getattr(policy, "active_states", ())
        states.append(told[0] if told else "")
    return OpenLoop(recording=recording, action=np.array(actions), states=tuple(states), drove=drove)
