"""A policy drives a Gymnasium env: the loop of `evaluation.loop` with one row."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from tral_env.errors import ConfigError
from tral_env.interface import CONTROL_RATE_HZ, Policy, check_readings
from tral_env.world import Step
from tral_fsm.evaluation.episode import Episode, Tick, TickRecorder
from tral_fsm.evaluation.loop import DriveLoop, Pair
from tral_fsm.evaluation.own_policy import OwnPolicy, as_policy
from tral_fsm.runtime.machine import Trace, Transit
from tral_fsm.runtime.policy import MachinePolicy

Index = NDArray[np.int64]


def drive(
    env: gym.Env[Any, Any],
    policy: Policy | Any,
    seed: int,
    options: dict[str, Any] | None = None,
    on_step: Callable[[Tick], None] | None = None,
    *,
    scenario: str = "",
) -> Episode:
    """Let a policy drive one episode; the same env, policy and seed give the same episode, bit for bit.

    Args:
        env: `TralCorridor-v0`, or anything with its info.
        policy: the policy, or any object with `act(observation)` or `predict(observation)`. Its `active_states` and
            `wanted_clearance` are recorded, if it has them.
        seed: seed of the course, the car and the noise.
        options: options of the env's reset.
        on_step: called after each tick.
        scenario: name of the course or family in the records.

    Returns:
        The episode with its trace.

    Raises:
        ConfigError: the policy needs a reading that the env does not have, or is none; a step of the env takes several
            ticks, or is none for this policy, see `tral_env.interface.check_readings`.
        PolicyError: the policy fails.
    """
    policy = as_policy(policy)
    check_readings(policy, env)
    _require_ticks(env)
    car, recorder = _GymCar(env, seed, options), TickRecorder()
    policy.reset(1)
    loop = DriveLoop(1, car, _OnePolicy(policy), lambda step, row: car.info)
    loop.begin(np.zeros(1, np.int64), {0: [recorder, *([on_step] if on_step is not None else [])]})
    try:
        ended = False
        while not ended:
            step = loop.tick()
            ended = bool(step.terminated[0] or step.truncated[0])
    finally:
        loop.end(0)
    figures = loop.metrics.figures(0, car.info)
    return Episode(seed=seed, scenario=scenario, trace=recorder.trace(), **figures)


def _require_ticks(env: gym.Env[Any, Any]) -> None:
    """Refuse decisions of several ticks and other observations: figures are of ticks, traces and videos of readings."""
    options = getattr(env.unwrapped, "learner_options", {})
    for name in ("decision_hz", "observation", "history"):
        if name in options:
            raise ConfigError(
                f"the environment was made with {name}={options[name]!r}, but a drive is measured and traced by the "
                f"plain readings, {CONTROL_RATE_HZ:g} times a second: make it without, and let the policy hold its "
                "command and make its features itself"
            )


_MEASURED = ("speed_mps", "lateral_offset_m", "clearance_left_m", "clearance_right_m")
"""Entries of info that the metrics read in each tick."""


class _GymCar:
    """A Gymnasium env as a row of cars."""

    def __init__(self, env: gym.Env[Any, Any], seed: int, options: dict[str, Any] | None) -> None:
        self._env = env
        self.world = getattr(env.unwrapped, "world", None)
        self.info: dict[str, Any] = {}
        """Info of the last tick."""
        self._observation, _ = env.reset(seed=seed, options=options)

    def observation(self) -> NDArray[np.floating]:
        """Observation of the policy, (1, d)."""
        row: NDArray[np.floating] = np.asarray(self._observation)[None]
        return row

    def step(self, command: NDArray[np.floating], rows: Index | None = None) -> Step:
        """Drive for one tick; `command` is (1, 2)."""
        self._observation, reward, terminated, truncated, self.info = self._env.step(command[0].copy())
        info = {name: np.array([self.info[name]], float) for name in _MEASURED if name in self.info}
        ended = np.array([terminated]), np.array([truncated])
        return Step(self.observation(), np.array([reward], float), *ended, dict(info), {})


class _OnePolicy:
    """A policy as that of one row."""

    def __init__(self, policy: MachinePolicy | OwnPolicy) -> None:
        self._policy = policy
        self._before: Trace | None = None

    def act(self, rows: Index, observation: NDArray[np.floating]) -> tuple[list[Any], list[Pair]]:
        """Command and wanted clearance."""
        command = np.asarray(self._policy.act(np.array(observation[0])), np.float32)
        side, metres = self._policy.wanted_clearance[0].tolist()
        return [command], [(side, metres)]

    def state(self, row: int) -> str:
        """Name of the active state; empty for a policy without states."""
        states = self._policy.active_states
        return states[0] if states else ""

    def watch(self, row: int, trace: Trace | None) -> None:
        """Report the transitions of a machine to `trace` too, beside the callback that it already has."""
        if not isinstance(self._policy, MachinePolicy):
            return
        if trace is None:
            self._policy.trace, self._before = self._before, None
            return
        before = self._before = self._policy.trace

        def both(transit: Transit) -> None:
            trace(transit)
            if before is not None:
                before(transit)

        self._policy.trace = both
