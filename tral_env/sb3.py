"""The native vector environment as a Stable-Baselines3 `VecEnv` (extra ``rl``).

SB3 does not take Gymnasium vector environments. It resets within the step, so the environment runs in "SameStep" mode,
and the wrapper reads what SB3 wants of an episode's end from `final_obs` and `final_info`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from tral_env.errors import ConfigError, MissingExtraError
from tral_env.vector_env import TralCorridorVectorEnv
from tral_env.vector_processes import TralCorridorProcesses, vector_env

try:
    from stable_baselines3.common.vec_env import VecEnv, VecMonitor
except ImportError as error:
    raise MissingExtraError("stable-baselines3", "rl", "tral_env.sb3") from error


MAX_PICTURES = 16
"""`render` shows so many cars at most."""


class SB3CorridorVecEnv(VecEnv):
    """The vector environment for SB3: observations (n, d) float32, rewards (n,) float32.

    At the end of an episode the row's info holds `terminal_observation`, `TimeLimit.truncated`, `is_success` and the
    environment's own final info; all other infos are empty.
    """

    def __init__(self, env: TralCorridorVectorEnv | TralCorridorProcesses) -> None:
        """Wrap an environment.

        Raises:
            ConfigError: the environment was not made with ``autoreset_mode="SameStep"``.
        """
        mode = env.metadata["autoreset_mode"]
        if mode is not AutoresetMode.SAME_STEP:
            raise ConfigError(f"autoreset_mode '{mode.value}': SB3 resets within the step: expected 'SameStep'")
        self.env = env
        self._seed: int | None = None
        self._actions: NDArray[np.floating] = np.zeros((env.num_envs, 2))
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.metadata["render_fps"] = env.metadata["render_fps"]

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed the next reset: row i with seed + i."""
        self._seed = int(np.random.default_rng().integers(2**31)) if seed is None else seed
        return [self._seed + i for i in range(self.num_envs)]

    def set_options(self, options: list[dict[str, Any]] | dict[str, Any] | None = None) -> None:
        """Options of the next reset, for all rows together: ``{"car": {"friction": 0.6}}``, or n values for a name.

        Raises:
            ConfigError: options for each row.
        """
        if isinstance(options, list | tuple):
            raise ConfigError("options for each row: expected one mapping; a parameter in 'car' takes a value a row")
        super().set_options(options)

    def reset(self) -> NDArray[np.float32]:
        """Start new episodes in all rows.

        From now on `reset_infos` holds the parameters of each row's car as "car", those of the episode that is driven.
        """
        observation, info = self.env.reset(seed=self._seed, options=self._options[0] or None)
        self._seed = None
        self._reset_options()
        self._tell_cars(info, range(self.num_envs))
        return np.asarray(observation, np.float32)

    def _tell_cars(self, info: dict[str, Any], rows: Iterable[int]) -> None:
        """Put the cars of rows that began an episode into `reset_infos`, a list that wrappers share."""
        for row in rows:
            self.reset_infos[row] = {"car": {name: float(value) for name, value in _row(info["car"], row).items()}}

    def step_async(self, actions: NDArray[np.floating]) -> None:
        """Keep the actions (n, 2) for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Drive all cars for a decision: observations (n, d), rewards (n,), dones (n,), an info for each row."""
        observation, reward, terminated, truncated, info = self.env.step(self._actions)
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(done):
            final = _row(info["final_info"], int(row))
            infos[row] = final | {
                "is_success": bool(final["success"]),
                "terminal_observation": info["final_obs"][row],
                "TimeLimit.truncated": bool(truncated[row] and not terminated[row]),
            }
        if done.any():
            self._tell_cars(info, np.flatnonzero(done).tolist())
        return np.asarray(observation, np.float32), reward.astype(np.float32), done, infos

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Pictures of the first cars, at most `MAX_PICTURES`; `render` puts them side by side."""
        return self.env.render_rows(range(min(self.num_envs, MAX_PICTURES)))

    def close(self) -> None:
        """Free what the environment holds."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the environment, once for each index: all rows share it."""
        return [getattr(self.env, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the environment that all rows share."""
        setattr(self.env, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of the environment once and give its answer for each index."""
        answer = getattr(self.env, method_name)(*args, **kwargs)
        return [answer] * len(list(self._get_indices(indices)))

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No row is wrapped: there are no single environments inside."""
        return [False] * len(list(self._get_indices(indices)))


class _Monitor(VecMonitor):
    """`VecMonitor` that has the `reset_infos` of its environment; wrappers of SB3 keep empty ones of their own."""

    def reset(self) -> Any:
        observation = super().reset()
        self.reset_infos = self.venv.reset_infos
        return observation


def _row(info: dict[str, Any], row: int) -> dict[str, Any]:
    """The entries of one row, without masks; so too within an entry."""
    return {
        name: _row(values, row) if isinstance(values, dict) else values[row]
        for name, values in info.items()
        if not name.startswith("_")
    }


def make_vec_env(
    num_envs: int = 64, *, seed: int | None = None, monitor: bool = True, processes: int = 1, **options: Any
) -> VecEnv:
    """A vector environment ready for SB3.

    Args:
        num_envs: n.
        seed: row i starts with seed + i.
        monitor: wrap it in `VecMonitor`, which counts episodes' rewards and lengths.
        processes: how many processes drive the cars; 1: this one. The drives are the same.
        options: those of `TralCorridorVectorEnv`, such as ``render_mode="rgb_array"`` for SB3's `VecVideoRecorder`.

    Returns:
        A `VecEnv`, for example ``PPO("MlpPolicy", make_vec_env(64, scenario="corners"))``.

    Raises:
        MissingExtraError: Stable-Baselines3 is not installed.
    """
    env = SB3CorridorVecEnv(vector_env(num_envs, processes=processes, autoreset_mode="SameStep", **options))
    env.seed(seed)
    return _Monitor(env, info_keywords=("is_success",)) if monitor else env
