"""n cars in n corridors, as one Gymnasium vector environment on one batch."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from tral_env.checks import is_seed, one_of
from tral_env.decisions import CorrectablePolicy, Decisions
from tral_env.errors import ConfigError
from tral_env.interface import CONTROL_RATE_HZ, FloatArray, action_space, as_command
from tral_env.options import CorridorConfig, JsonSpec, check_counts, option_parameters, takes
from tral_env.world import Step, World, check_pictures


@takes(option_parameters())
class TralCorridorVectorEnv(JsonSpec, VectorEnv[FloatArray, FloatArray, NDArray[Any]]):
    """`TralCorridor-v0`, n at once: ``gym.make_vec("TralCorridor-v0", num_envs=64)``.

    Row i, reset with seed s + i, is bit for bit the single environment reset with that seed, whatever the other rows
    do. The options are those of `TralCorridorEnv`, and three more arguments:

    - `num_envs`: number of cars, n.
    - `autoreset_mode`: "NextStep" (default), "SameStep" or "Disabled", as Gymnasium defines them. With "SameStep"
      `info["final_obs"]` is (n, d) and `info["final_info"]` a dict of arrays, and masks `_final_obs` and `_final_info`
      tell which rows have them. With "Disabled" a row that ended rests, earns nothing and tells again how it ended,
      until ``reset(options={"reset_mask": mask})`` names it: so an evaluation drives until all rows have ended.
    - `nthread`: number of threads that step the cars; the results do not depend on it.

    For training, ``courses=500`` keeps 500 courses instead of building one for every episode: a reset takes a third of
    the time or less. They have the seeds 0 to 499; the courses of validations begin at 500.

    Every entry of `info` is an array of (n, ...) with a mask `_name`; `info["car"]` of a reset holds the parameters of
    the cars in the same way, and that of a step those of the rows that began an episode in it.
    ``options={"car": {"friction": np.linspace(0.5, 1.2, n)}}`` sweeps a parameter.

    With ``render_mode="rgb_array"`` `render()` gives a picture of each car, as Gymnasium's `RecordVideo` for vector
    environments wants it.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": int(CONTROL_RATE_HZ)}  # noqa: RUF012 (Gymnasium declares it so)

    def __init__(
        self,
        num_envs: int = 1,
        autoreset_mode: str | AutoresetMode = "NextStep",
        nthread: int = 2,
        *,
        render_mode: str | None = None,
        view: str = "chase",
        width: int = 640,
        height: int = 480,
        **options: Any,
    ) -> None:
        check_counts(num_envs=num_envs, nthread=nthread)
        check_pictures(render_mode, view, width, height)
        self.render_mode, self._view, self._size = render_mode, view, (width, height)
        self._mode = _autoreset_mode(autoreset_mode)
        config = CorridorConfig.of(options, allowed=inspect.signature(type(self)).parameters)
        fps = round(config.decision_hz)
        self.metadata = {**type(self).metadata, "render_fps": fps, "autoreset_mode": self._mode}
        self.num_envs = num_envs
        self.world = World(num_envs, config, nthread=nthread)
        self._decisions = Decisions(self.world)
        self.single_observation_space = self._decisions.space()
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._rngs: list[np.random.Generator] = []
        self._everyone = np.arange(num_envs)
        self._done = np.zeros(num_envs, bool)

    @property
    def provided_readings(self) -> frozenset[str]:
        """Names of the fields that the cars measure: all of the observation."""
        return frozenset(self.world.layout.names)

    @property
    def learner_options(self) -> dict[str, object]:
        """Options, name -> value, with which a step is no plain tick, for `tral_env.interface.check_readings`."""
        return self.world.config.learner_options

    def correct(self, policy: CorrectablePolicy, steering: float, speed: float) -> None:
        """Let a policy drive, and take actions as corrections of it from now on; before the first reset.

        Args:
            policy: it sees the plain readings of every tick, and has `reset_rows` and `scale_speeds`, as machines have.
            steering: largest correction of the steering: action 1 adds so much.
            speed: largest correction of the speed, as a share of it: with 0.5, action 1 makes it 1.5 times as fast.

        Raises:
            ConfigError: a largest correction is no number above 0, at most 1.
        """
        self._decisions.correct(policy, steering, speed)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start new episodes, in all rows or in those of ``options["reset_mask"]``.

        Args:
            seed: row i is seeded with seed + i, or with seed[i].
            options: as in `TralCorridorEnv`, and ``reset_mask``: (n,) bool.

        Returns:
            Observations (n, d), and the info of all rows.

        Raises:
            ConfigError: a seed or an option is unknown or not allowed, or the first reset leaves out a row.
            CourseError: the course cannot be built, or its file is no course.
        """
        mask = None
        if isinstance(options, dict) and "reset_mask" in options:
            mask = options["reset_mask"]
            options = {name: value for name, value in options.items() if name != "reset_mask"}
        rows = self._everyone if mask is None else self._rows(mask)
        request = self.world.request(rows, options)
        self._seed(seed, rows)
        cars = self._decisions.reset(request, self._rngs)
        self._done[rows] = False
        info = self.world.info()
        if self._done.any():
            info = self._told_again(info, self._done)
        return self._decisions.observation(), _masked(info | {"car": cars})

    def _rows(self, mask: Any) -> NDArray[np.int64]:
        if self._mode is not AutoresetMode.DISABLED:
            raise ConfigError(
                f"reset_mask with autoreset_mode='{self._mode.value}', which resets the rows that ended: expected "
                "autoreset_mode='Disabled', or a reset of all rows"
            )
        mask = np.asarray(mask)
        if mask.shape != (self.num_envs,) or mask.dtype != bool:
            raise ConfigError(f"reset_mask is {mask.dtype} {mask.shape}: expected bool ({self.num_envs},)")
        return np.flatnonzero(mask)

    def _seed(self, seed: int | Sequence[int | None] | None, rows: NDArray[np.int64]) -> None:
        seeds = seeds_of_rows(seed, self.num_envs)
        fresh = {row: seeding.np_random(seeds[row])[0] for row in rows if seeds[row] is not None or not self._rngs}
        self._rngs = [fresh.get(row) or self._rngs[row] for row in range(self.num_envs)]

    def step(self, actions: FloatArray) -> tuple[FloatArray, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Drive all cars for a decision, which is 12.5 ms by default.

        Args:
            actions: (n, 2) steering, throttle.

        Returns:
            Observations (n, d), rewards (n,), terminated (n,), truncated (n,), info.

        Raises:
            ConfigError: actions of another shape or not finite, or there was no reset.
            SimulationError: the physics of a row became unstable; it has to be reset.
        """
        command = as_command(actions, self.num_envs)
        ended = self._done.copy()
        step = self._decisions.step(command, np.flatnonzero(~ended) if ended.any() else None)
        if ended.any():
            if self._mode is AutoresetMode.NEXT_STEP:
                return self._after_next_step_reset(step, ended)
            step = self._resting(step, ended)
        self._last = step
        self._done = step.terminated | step.truncated
        observation, info = step.observation, _masked(step.info | {"reward_terms": step.reward_terms})
        if self._mode is not AutoresetMode.SAME_STEP:
            info |= self._success()
        if self._mode is AutoresetMode.SAME_STEP and self._done.any():
            info["final_obs"], info["_final_obs"] = observation.copy(), self._done.copy()
            final = step.info | {"is_success": step.info["success"], "reward_terms": step.reward_terms}
            info["final_info"], info["_final_info"] = _masked(final, self._done), self._done.copy()
            info |= _earned(step.reward_terms, ~self._done)
            cars = self._decisions.reset(self.world.request(np.flatnonzero(self._done)), self._rngs)
            info |= _masked({"car": cars}, self._done)
            self._done = np.zeros(self.num_envs, bool)
            observation = self._decisions.observation()
            info |= _masked(self.world.info())
        return observation, step.reward, step.terminated, step.truncated, info

    def _resting(self, step: Step, ended: NDArray[np.bool_]) -> Step:
        """The step in which the rows that ended stand, earn nothing and tell again how they ended."""
        last = self._last
        return Step(
            step.observation,
            np.where(ended, 0.0, step.reward),
            np.where(ended, last.terminated, step.terminated),
            np.where(ended, last.truncated, step.truncated),
            self._told_again(step.info, ended),
            {name: np.where(ended, 0.0, values) for name, values in step.reward_terms.items()},
        )

    def _told_again(self, info: Mapping[str, NDArray[Any]], ended: NDArray[np.bool_]) -> dict[str, NDArray[Any]]:
        """Info in which the rows that ended tell once more what they told at their end."""
        return {name: np.where(_like(ended, values), self._last.info[name], values) for name, values in info.items()}

    def _after_next_step_reset(
        self, step: Step, again: NDArray[np.bool_]
    ) -> tuple[FloatArray, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Start the rows anew that ended in the step before; this step does nothing else with them."""
        cars = self._decisions.reset(self.world.request(np.flatnonzero(again)), self._rngs)
        terminated, truncated = step.terminated & ~again, step.truncated & ~again
        self._done = terminated | truncated
        reward = np.where(again, 0.0, step.reward)
        fresh = self.world.info()
        info = {name: np.where(_like(again, values), fresh[name], values) for name, values in step.info.items()}
        self._last = Step(self._decisions.observation(), reward, terminated, truncated, info, step.reward_terms)
        told = _masked(info) | _earned(step.reward_terms, ~again) | self._success() | _masked({"car": cars}, again)
        return self._last.observation, reward, terminated, truncated, told

    def _success(self) -> dict[str, Any]:
        """``is_success`` of the rows that have ended; nothing while all are under way."""
        return _masked({"is_success": self._last.info["success"]}, self._done) if self._done.any() else {}

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """The chosen view of each car, n of (height, width, 3) uint8; None without a render mode."""
        return None if self.render_mode is None else self.render_rows(range(self.num_envs))

    def render_rows(self, rows: Iterable[int]) -> tuple[NDArray[np.uint8], ...]:
        """The chosen view of some cars, at any time.

        Args:
            rows: the cars.

        Returns:
            (height, width, 3) uint8 each.

        Raises:
            ConfigError: there was no reset.
            RenderError: no OpenGL on this machine.
        """
        return tuple(self.world.render(self._view, row, *self._size) for row in rows)

    def close_extras(self, **kwargs: Any) -> None:
        """Free what OpenGL holds."""
        self.world.close()


def seeds_of_rows(seed: int | Sequence[int | None] | None, n: int) -> list[int | None]:
    """One seed for each of n rows: seed + i, or seed[i]; None: the row goes on drawing.

    Raises:
        ConfigError: it is no seed, or not one for each row.
    """
    if seed is None:
        return [None] * n
    if is_seed(seed):
        return [int(seed) + i for i in range(n)]  # type: ignore[arg-type]
    wrong = f"seed = {seed!r}: expected a whole number, or one for each of {n} environments, 0 or more"
    if not isinstance(seed, Iterable):
        raise ConfigError(wrong)
    seeds = list(seed)
    if not all(map(is_seed, seeds)):
        raise ConfigError(wrong)
    if len(seeds) != n:
        raise ConfigError(f"{len(seeds)} seeds for {n} environments")
    return [None if each is None else int(each) for each in seeds]


def _autoreset_mode(mode: str | AutoresetMode) -> AutoresetMode:
    if not isinstance(mode, AutoresetMode):
        one_of("autoreset_mode", mode, (each.value for each in AutoresetMode))
    return AutoresetMode(mode)


def _like(mask: NDArray[np.bool_], values: NDArray[Any]) -> NDArray[np.bool_]:
    return mask.reshape(-1, *[1] * (values.ndim - 1))


def _earned(terms: Mapping[str, NDArray[Any]], rows: NDArray[np.bool_]) -> dict[str, Any]:
    """The terms of the reward as an entry of info; rows outside the mask began an episode and have none."""
    return _masked({"reward_terms": {name: np.where(rows, values, 0.0) for name, values in terms.items()}}, rows)


def _masked(info: Mapping[str, Any], mask: NDArray[np.bool_] | None = None) -> dict[str, Any]:
    """Info with a mask beside each entry, as Gymnasium's vector environments have it; so too within an entry.

    Args:
        info: name -> (n, ...) or a mapping of such.
        mask: (n,) rows that have the entries; None: all.
    """
    if mask is None:
        first = next(iter(info.values()), np.zeros(0))
        mask = np.ones(len(first), bool)
    told: dict[str, Any] = {}
    for name, values in info.items():
        told[name] = _masked(values, mask) if isinstance(values, dict) else values
        told[f"_{name}"] = mask.copy()
    return told
