"""A briefly trained PPO beside the state machine, on the same courses and seeds.

    python benchmarks/compare.py --steps 20000 --scenario straight --seeds 1000:1010

A few thousand steps make no good driver. The figures show that training works from env to policy, and what a learner
has to beat.
"""

from __future__ import annotations

import contextlib
import math
import time
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import typer
from rich import box
from rich.table import Table

from tral_env.errors import MissingExtraError, TralError
from tral_fsm import load_policy
from tral_fsm.evaluation.choices import Randomization, check_families
from tral_fsm.evaluation.files import prepare_folder, write_json
from tral_fsm.evaluation.host import host
from tral_fsm.evaluation.rollout import drive
from tral_fsm.evaluation.seeds import parse_seeds
from tral_fsm.evaluation.summary import Summary, summarize
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


def command(choice: Any) -> Any:
    """Steering and throttle (2,) of a choice in [-1, 1] x [-1, 1]."""
    low, high = THROTTLE
    return np.array([choice[0], low + (high - low) * (choice[1] + 1) / 2], np.float32)


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
    """A trained model as a policy, which decides as often as in its training."""

    def __init__(self, model: Any, normalizer: Any) -> None:
        self._model, self._normalizer = model, normalizer
        self.reset()

    @property
    def decisions(self) -> int:
        """Number of decisions of its training: whole rollouts, so a few more than were asked for."""
        return int(self._model.num_timesteps)

    def reset(self, n: int = 1) -> None:
        """Start anew."""
        self._ticks = 0
        self._action = np.zeros(2, np.float32)

    def act(self, observation: Any) -> Any:
        """Command for one car, (2,)."""
        if self._ticks % REPEAT == 0:
            normal = self._normalizer.normalize_obs(observation)
            choice, _ = self._model.predict(normal, deterministic=True)
            self._action = command(choice)
        self._ticks += 1
        return self._action


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


def evaluate(policy: Any, scenario: str, randomization: str, seeds: range) -> list[dict[str, Any]]:
    """Records of a policy's episodes."""
    env = gym.make("tral_env:TralCorridor-v0", scenario=scenario, camera="projected", randomization=randomization)
    with contextlib.closing(env):
        return [drive(env, policy, seed, scenario=scenario).record() for seed in seeds]


def main(
    steps: Annotated[int, typer.Option(help="Number of decisions of PPO's training.")] = 20_000,
    scenario: str = "straight",
    seeds: Annotated[str, typer.Option(help="Seeds FIRST:END of the evaluation.")] = "1000:1010",
    policy: Annotated[str, typer.Option(help="Name of a packaged machine, or a machine file.")] = "office",
    randomization: Randomization = "default",
    seed: Annotated[int, typer.Option(help="Seed of the training.")] = 0,
    out: Path = Path("benchmarks/results/compare.json"),
) -> None:
    """Train PPO, let both policies drive, print and write the figures."""
    try:
        run = parse_seeds(seeds)
        check_families([scenario])
        rival = load_policy(policy)
        prepare_folder(out.parent)
        start = time.perf_counter()
        learner = train(scenario, randomization, steps, seed)
        trained_s = time.perf_counter() - start
        steps = learner.decisions
        drivers = {f"machine {policy}": rival, "PPO": learner}
        records = {name: evaluate(driver, scenario, randomization, run) for name, driver in drivers.items()}
    except TralError as error:
        raise SystemExit(f"Error: {error}") from None
    figures = {name: summarize(rows) for name, rows in records.items()}
    print_figures(
        table(figures, f"{scenario}, seeds {seeds}, {randomization}; PPO: {steps} steps in {trained_s:.0f} s")
    )
    result = {
        "host": host(),
        "training": {
            "algorithm": "PPO",
            "steps": steps,
            "seed": seed,
            "repeat": REPEAT,
            "seconds": round(trained_s, 1),
        },
        "learner": {name: metadata.version(name) for name in ("stable-baselines3", "torch")},
        "scenario": scenario,
        "seeds": seeds,
        "randomization": randomization,
        "figures": {name: asdict(summary) for name, summary in figures.items()},
        "episodes": records,
    }
    write_json(out, result)


def table(figures: dict[str, Summary], title: str) -> Table:
    """Table with a row for each driver."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("driver", no_wrap=True)
    for heading in ("success", "95 %", "progress", "time", "speed", "clearance\nRMSE", "off the\nroute"):
        table.add_column(heading, justify="right", no_wrap=True)
    for name, row in figures.items():
        table.add_row(
            name,
            f"{row.successes}/{row.episodes}",
            f"{100 * row.success_low:.0f}-{100 * row.success_high:.0f} %",
            f"{100 * row.progress:.0f} %",
            "-" if row.time_s is None else f"{row.time_s:.1f} s",
            f"{row.mean_speed_mps:.2f} m/s",
            "-" if row.clearance_rmse_m is None else f"{100 * row.clearance_rmse_m:.1f} cm",
            "-" if row.lateral_rms_m is None else f"{100 * row.lateral_rms_m:.1f} cm",
        )
    return table


if __name__ == "__main__":
    typer.run(main)
