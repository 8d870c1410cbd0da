"""Recordings held against what might have been: the simulated car on the same commands, the answers of a policy."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from tral_env.errors import BadFileError, ConfigError
from tral_env.interface import CONTROL_PERIOD_S, NO_ECHO_M, Policy
from tral_env.recording.read import Recording
from tral_env.se2 import wrap
from tral_fsm.evaluation.recording import COURSE, MACHINE, files_of_policy
from tral_fsm.runtime.policy import MachinePolicy

Array = NDArray[np.float64]
QUANTITIES: Mapping[str, str] = {
    "ultrasonic_left": "m",
    "ultrasonic_front": "m",
    "ultrasonic_right": "m",
    "speed": "m/s",
    "yaw_rate": "rad/s",
}
"""What a drive and its simulation are compared by, and its unit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """A recorded drive beside the simulated one on the same commands, T ticks."""

    time_s: Array
    """(T,) time since the start, s."""
    recorded: Mapping[str, Array]
    """Quantity -> (T,); NaN where it was not measured, and where an ultrasonic heard no echo."""
    simulated: Mapping[str, Array]
    """The same of the simulated car; NaN after the end of its episode, too."""
    outcome: str
    """How the simulated drive ended before the recorded one; empty: it did not."""

    def residual(self, quantity: str) -> Array:
        """(T,) recorded minus simulated; NaN where one of them is."""
        difference: Array = self.recorded[quantity] - self.simulated[quantity]
        return difference

    def record(self) -> dict[str, Any]:
        """The residuals in figures: root of the mean square, largest, number of ticks; None without a tick."""
        return {name: self._figures(name) for name in QUANTITIES}

    def write_csv(self, path: Path) -> None:
        """Write a row for each tick; a cell is empty where nothing was measured."""
        with path.open("w", encoding="utf-8", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(["time_s", *(f"{what}_{name}" for name in QUANTITIES for what in ("recorded", "simulated"))])
            columns = [side[name] for name in QUANTITIES for side in (self.recorded, self.simulated)]
            for time_s, *numbers in zip(self.time_s, *columns, strict=True):
                rows.writerow([f"{time_s:.4f}", *("" if math.isnan(one) else f"{one:.6f}" for one in numbers)])

    def _figures(self, name: str) -> dict[str, Any]:
        found = self.residual(name)
        found = found[np.isfinite(found)]
        if not len(found):
            return {"rms": None, "largest": None, "ticks": 0}
        return {
            "rms": float(np.sqrt(np.mean(found**2))),
            "largest": float(np.abs(found).max()),
            "ticks": len(found),
        }


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
                outcome = next((name for name in ("success", "collision", "missed_gate") if info[name]), "timeout")
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


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenLoop:
    """What a policy would have done in each tick of a recorded drive, T ticks."""

    recording: Recording
    action: Array
    """(T, 2) its steering and throttle."""
    states: tuple[str, ...]
    """(T,) the state that it was in after the tick; empty for a policy without states."""
    drove: bool
    """Whether it is the machine that drove."""

    @property
    def difference(self) -> Array:
        """(T, 2) its answer minus the recorded one."""
        difference: Array = self.action - self.recording.action
        return difference

    def record(self) -> dict[str, Any]:
        """The differences in figures."""
        size = np.abs(self.difference)
        return {
            "ticks": len(size),
            "drove": self.drove,
            **{
                name: {
                    "rms": float(np.sqrt(np.mean(column**2))),
                    "largest": float(column.max()),
                    "different": int(np.count_nonzero(column)),
                }
                for name, column in zip(("steering", "throttle"), size.T, strict=True)
            },
        }

    def write_csv(self, path: Path) -> None:
        """Write a row for each tick."""
        recorded = self.recording
        columns = ("steering", "throttle")
        with path.open("w", encoding="utf-8", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            heads = [f"{what}{name}" for what in ("recorded_", "policy_", "difference_") for name in columns]
            rows.writerow(["tick", "time_s", *heads, "recorded_state", "policy_state"])
            for k, tick in enumerate(recorded.tick.tolist()):
                numbers = (*recorded.action[k], *self.action[k], *self.difference[k])
                texts = [f"{number:.6f}" for number in numbers]
                rows.writerow([tick, f"{recorded.time_s[k]:.4f}", *texts, recorded.states[k], self.states[k]])


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
    drove = recording.files.get(MACHINE) == files_of_policy(source, policy).get(MACHINE, b"")
    policy.reset(1)
    if isinstance(policy, MachinePolicy) and not drove:
        policy.shadow(np.array([True]))
    actions, states = [], []
    for row in recording.observation:
        actions.append(np.asarray(policy.act(row.copy()), float))
        told = getattr(policy, "active_states", ())
        states.append(told[0] if told else "")
    return OpenLoop(recording=recording, action=np.array(actions), states=tuple(states), drove=drove)
