"""Cars whose decisions are held for several ticks, and whose drivers see what a learner sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from tral_env import task
from tral_env.arrays import Array, Flags, Index
from tral_env.interface import Policy
from tral_env.learner import Actuation, LearnerView, check_correction, speed_factors, steered
from tral_env.world import ResetRequest, Step, World


class CorrectablePolicy(Policy, Protocol):
    """A policy that begins anew in some rows, and drives them faster or slower than it wants."""

    def reset_rows(self, rows: Flags) -> None:
        """Start the cars again where `rows` (n,) is true."""
        ...

    def scale_speeds(self, factors: NDArray[np.floating]) -> None:
        """Multiply the speeds that it wants of the cars by factors (n,) from now on."""
        ...


class Decisions:
    """A world that takes one action a decision; with the default options a decision is a tick."""

    def __init__(self, world: World) -> None:
        """Look at a world through the options of its configuration."""
        config = world.config.learner
        self.world, self._ticks = world, config.decision_ticks
        self._is_plain = config.observation == "readings" and config.history == 1
        self._is_tick = self._is_plain and config.decision_ticks == 1 and config.action == "throttle"
        self._is_tick &= config.drive_range is None
        """Whether a decision is a tick, its action a command, and its observation the readings."""
        self._view = LearnerView(config, world.n, world.layout)
        self._actuation = Actuation(config, world.n)
        self._base: CorrectablePolicy | None = None
        self._bounds = (1.0, 1.0)
        self._speed = world.layout.column("speed")
        self._readings: NDArray[np.float32] = np.zeros((world.n, world.layout.size), np.float32)

    def correct(self, policy: CorrectablePolicy, steering: float, speed: float) -> None:
        """Let a policy drive at every tick, and take actions as corrections of it; before a reset.

        Args:
            policy: it sees the plain readings.
            steering: largest correction of the steering, which is added.
            speed: largest correction of the speed, as a share of it.

        Raises:
            ConfigError: a largest correction is no number above 0, at most 1.
        """
        check_correction(steering, speed)
        policy.reset(self.world.n)
        self._base, self._bounds = policy, (steering, speed)

    def space(self) -> spaces.Box:
        """Space of one car's observation."""
        readings = self.world.layout.space()
        if self._is_plain:
            return readings
        if self.world.config.observation == "features":
            return spaces.Box(-1.0, 1.0, (self._view.size,), np.float32)
        history = self.world.config.history
        return spaces.Box(np.tile(readings.low, history), np.tile(readings.high, history), dtype=np.float32)

    def reset(self, request: ResetRequest, rngs: Sequence[np.random.Generator]) -> dict[str, Array]:
        """Put cars at the start of new courses, see `World.reset`."""
        cars = self.world.reset(request, rngs)
        rows = np.zeros(self.world.n, bool)
        rows[request.rows] = True
        self._readings = self.world.observation()
        self._actuation.reset(rows)
        if self._base is not None:
            self._base.reset_rows(rows)
        if not self._is_plain:
            self._view.reset(rows, self._readings)
        return cars

    def observation(self) -> NDArray[np.float32]:
        """What the policies are told now, (n, size)."""
        return self._readings if self._is_plain else self._view.observation()

    def step_alone(self, actions: NDArray[np.floating]) -> Step:
        """`step` of a car alone, which may give its numbers as such."""
        if not self._is_tick:
            return self.step(actions)
        step = self.world.tick(actions)
        self._readings = step.observation
        return step

    def step(self, actions: NDArray[np.floating], rows: Index | None = None) -> Step:
        """Hold one decision; a car whose episode ends in it stays where it is.

        Args:
            actions: (n, 2) as the options say.
            rows: (k,) the cars that move; None: all.

        Returns:
            Rewards and their terms are summed over the decision; all else is as at the last tick of each car.

        Raises:
            ConfigError: the cars have no courses yet.
            SimulationError: the physics of a car became unstable; it has to be reset.
        """
        if self._is_tick and self._base is None:
            step = self.world.step(actions, rows)
            self._readings = step.observation
            return step
        wanted = self._actuation.wanted(actions)
        driving = None if rows is None else self._mask(rows)
        total: Step | None = None
        for _ in range(self._ticks):
            moved = np.ones(self.world.n, bool) if driving is None else driving
            command: NDArray[np.floating] = self._actuation.command(wanted, self._readings[:, self._speed], driving)
            if self._base is not None:
                self._base.scale_speeds(speed_factors(command, self._bounds[1]))
                command = steered(self._base.act(self._readings), command, self._bounds[0])
            step = self.world.step(command, None if driving is None else np.flatnonzero(driving))
            ended = (step.terminated | step.truncated) & moved
            total = step if total is None else _added(total, step, moved)
            self._readings = total.observation
            if not self._is_plain:
                self._view.update(self._readings, driving, ended)
            if ended.any():
                driving = moved & ~ended
            if driving is not None and not driving.any():
                break
        assert total is not None, "a decision takes a tick or more"
        return total if self._is_plain else replace(total, observation=self._view.observation())

    def _mask(self, rows: Index) -> Flags:
        mask = np.zeros(self.world.n, bool)
        mask[rows] = True
        return mask


def _added(total: Step, step: Step, moved: Flags) -> Step:
    """Two ticks as one: rewards add up, all else is that of the later tick in the rows that moved in it."""

    def later(old: NDArray[Any], new: NDArray[Any]) -> NDArray[Any]:
        return new if moved.all() else np.where(moved.reshape(-1, *[1] * (new.ndim - 1)), new, old)

    terms = {
        name: total.reward_terms[name] + np.where(moved, values, 0.0) for name, values in step.reward_terms.items()
    }
    return Step(
        later(total.observation, step.observation),
        task.reward(terms),
        later(total.terminated, step.terminated),
        later(total.truncated, step.truncated),
        {name: later(total.info[name], values) for name, values in step.info.items()},
        terms,
    )
