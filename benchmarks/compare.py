"""PPO, trained briefly, beside machines and built-in policies on courses that it has not seen.

    python benchmarks/compare.py --steps 20000 --scenario straight --courses 10 --out runs/compare_ppo

A few thousand steps make no good driver. The figures show that training works from env to policy, and what a learner
has to beat. PPO's set-up is its own here; `tral train` has a better one. All else is `tral compare`, with its page and
its records. Started again, the script trains again, and drives what is missing. With --suite standard the same
contenders drive the courses of the standard table.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import time
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import typer
from numpy.typing import NDArray

from tral_env.errors import MissingExtraError, TralError
from tral_fsm.evaluation.choices import Randomization, families
from tral_fsm.evaluation.contenders import Agent, Contender, contenders, object_agent
from tral_fsm.evaluation.suites import Suite, suite
from tral_fsm.programs.compare import PAGE, compare
from tral_fsm.report.compare.table import table
from tral_fsm.terminal import print_figures

REPEAT = 8
"""Ticks for which the learner's command is held: the learner decides ten times a second."""
ENVS = 4
BATCH = 256
MAX_BATCHES = 8
"""Number of batches of decisions, from all environments together, that PPO learns from at once. Fewer in a training
that is shorter."""
THROTTLE = 0.1, 0.4
"""Range of the learner's throttle: the car always rolls, at up to 0.8 m/s. A brief training that may also stand, brake
and reverse learns to stand, because a car that stands does not collide."""


def command(choice: Any) -> NDArray[np.float32]:
    """Steering and throttle (..., 2) of choices in [-1, 1] x [-1, 1]."""
    low, high = THROTTLE
    choice = np.asarray(choice, np.float32)
    return np.stack([choice[..., 0], low + (high - low) * (choice[..., 1] + 1) / 2], axis=-1).astype(np.float32)


class Repeat(gym.Wrapper[Any, Any, Any, Any]):
    """An env that holds each choice for `REPEAT` ticks and adds up their rewards."""

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Hold a choice; the reward is the sum over the ticks."""
        total = 0.0
        for _ in range(REPEAT):
            observation, reward, terminated, truncated, info = self.env.step(command(action))
            total += float(reward)
            if terminated or truncated:
                break
        return observation, total, terminated, truncated, info


class Learner:
    """A trained model as a policy for many cars, which decides as often as in its training."""

    def __init__(self, model: Any, normalizer: Any) -> None:
        self._model, self._normalizer = model, normalizer
        self.reset()

    @property
    def decisions(self) -> int:
        """Number of decisions of its training: whole rollouts, so a few more than were asked for."""
        return int(self._model.num_timesteps)

    @property
    def digest(self) -> str:
        """Digest of its weights, 16 hexadecimal digits."""
        weights = hashlib.sha256()
        for values in self._model.policy.state_dict().values():
            weights.update(values.numpy().tobytes())
        return weights.hexdigest()[:16]

    def reset(self, n: int = 1) -> None:
        """Start anew with n cars."""
        self._ticks = np.zeros(n, np.int64)
        self._action = np.zeros((n, 2), np.float32)

    def reset_rows(self, rows: NDArray[np.bool_]) -> None:
        """Start the cars again where `rows` (n,) is true."""
        self._ticks[rows] = 0

    def act(self, observation: NDArray[np.floating]) -> NDArray[np.float32]:
        """Commands (n, 2) of the cars, or (2,) of one."""
        rows = np.atleast_2d(observation)
        due = self._ticks % REPEAT == 0
        if due.any():
            choice, _ = self._model.predict(self._normalizer.normalize_obs(rows[due]), deterministic=True)
            self._action[due] = command(choice)
        self._ticks += 1
        return self._action.copy() if observation.ndim == 2 else self._action[0].copy()


def train(scenario: str, randomization: str, steps: int, seed: int) -> Learner:
    """Train PPO for a number of decisions.

    Raises:
        MissingExtraError: stable-baselines3 or torch is not installed.
    """
    try:
        import torch
        from stable_baselines3 import PPO
        from stable_baselines3.common.env_util import make_vec_env
        from stable_baselines3.common.vec_env import VecNormalize
    except ImportError as error:
        raise MissingExtraError(error.name or "stable-baselines3", "rl", "training PPO") from error
    torch.set_num_threads(1)  # nets this small are slower on more
    envs = make_vec_env(
        "tral_env:TralCorridor-v0",
        n_envs=ENVS,
        seed=seed,
        env_kwargs={"scenario": scenario, "camera": "projected", "randomization": randomization},
        wrapper_class=Repeat,
    )
    with contextlib.closing(VecNormalize(envs)) as normalized:
        rollout = min(MAX_BATCHES, math.ceil(steps / BATCH)) * BATCH // ENVS
        model = PPO("MlpPolicy", normalized, n_steps=rollout, batch_size=BATCH, gamma=0.99, seed=seed, device="cpu")
        model.learn(steps, progress_bar=False)
        normalized.training = False
        return Learner(model, normalized)


def ppo(scenario: str, randomization: str, steps: int, seeds: range) -> Contender:
    """PPO, trained once with each seed."""
    agents: list[Agent] = []
    for seed in seeds:
        start = time.perf_counter()
        learner = train(scenario, randomization, steps, seed)
        told = {
            "decisions": learner.decisions,
            "seed": seed,
            "trained on": f"{scenario}, {randomization}",
            "seconds": round(time.perf_counter() - start, 1),
            **{name: metadata.version(name) for name in ("stable-baselines3", "torch")},
        }
        agents.append(object_agent(f"PPO {seed}", learner, learner.digest, **told))
    return Contender(name="PPO", agents=tuple(agents))


def main(
    steps: Annotated[int, typer.Option(min=0, help="Number of decisions of PPO's training; 0: no PPO.")] = 20_000,
    scenario: Annotated[str, typer.Option(help="Family of the training, and of the courses without --suite.")] = (
        "straight"
    ),
    policies: Annotated[str, typer.Option(help="The other contenders, as `tral compare` takes them.")] = (
        "office,pursuit,constant"
    ),
    suite_name: Annotated[
        str, typer.Option("--suite", help="A suite instead of courses of the training's family.")
    ] = "",
    courses: Annotated[
        int | None, typer.Option(min=1, help="Courses of each family and level; 10 without --suite.")
    ] = (None),
    randomization: Randomization = "default",
    seed: Annotated[int, typer.Option(help="Seed of the first training.")] = 100_000,
    agents: Annotated[int, typer.Option(min=1, help="Number of trainings, each with the next seed.")] = 1,
    out: Path = Path("runs/compare_ppo"),
) -> None:
    """Train PPO, let all contenders drive, print and write the figures."""
    try:
        (family,) = families(scenario)[:1]
        own = Suite(name="own", families=(family,), levels=(randomization,), split="validation", courses=10)
        chosen = (suite(suite_name) if suite_name else own).with_courses(courses)
        field = contenders(policies)
        if steps:
            field.append(ppo(family, randomization, steps, range(seed, seed + agents)))
        shown = compare(chosen, field, out)
    except TralError as error:
        raise SystemExit(f"Error: {error}") from None
    print_figures(table(shown))
    print(f"Page: {out / PAGE}")


if __name__ == "__main__":
    typer.run(main)
