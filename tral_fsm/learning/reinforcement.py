"""A network learns from the reward: PPO and SAC of Stable-Baselines3, alone or as a correction of a machine."""

from __future__ import annotations

import importlib.util
import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tral_env.checks import is_number
from tral_env.config import TaskConfig, as_config
from tral_env.errors import ConfigError, MissingExtraError
from tral_env.learned import Correction, Network
from tral_env.learner import LearnerConfig
from tral_fsm.formats import library, tral_json
from tral_fsm.learning import start
from tral_fsm.learning.choices import TrainRequest, check_size, positive, read_settings, sees_detections
from tral_fsm.learning.export import network_of_model
from tral_fsm.learning.networks import ACTIVATIONS, falling, torch
from tral_fsm.learning.run import RECENT, TrainingRun
from tral_fsm.runtime.policy import MachinePolicy

try:
    from stable_baselines3 import PPO, SAC
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.logger import Logger
    from stable_baselines3.common.vec_env import VecEnv, VecNormalize

    from tral_env.sb3 import make_vec_env
except ImportError as error:
    raise MissingExtraError("stable-baselines3", "rl", "tral train --algo ppo, sac or residual") from error

_FOREVER = 10**12
"""More steps than any training takes: the run says when it is over."""


@dataclass(frozen=True, kw_only=True)
class ReinforcementSettings:
    """Hyper-parameters; their meaning stands in the files of settings/."""

    learner: LearnerConfig
    task: Mapping[str, Any]
    anywhere: float
    cars: int
    layers: tuple[int, ...]
    activation: str
    normalize_inputs: bool
    normalize_reward: bool
    policy: Mapping[str, Any]
    algorithm: Mapping[str, Any]

    def __post_init__(self) -> None:
        check_size(self.cars, self.layers)
        as_config(TaskConfig, self.task)
        if self.activation not in ACTIVATIONS:
            raise ConfigError(f"activation = {self.activation!r}: expected one of {', '.join(ACTIVATIONS)}")


@dataclass(frozen=True, kw_only=True)
class PPOSettings(ReinforcementSettings):
    """Those of PPO, how much it explores at first, and how far its learning rate falls."""

    noise: float
    last_rate: float

    def __post_init__(self) -> None:
        super().__post_init__()
        positive(self, "noise")
        if not is_number(self.last_rate) or not 0.0 <= self.last_rate <= 1.0:
            raise ConfigError(f"last_rate = {self.last_rate!r}: expected 0 to 1")
        rate = self.algorithm.get("learning_rate")
        if not is_number(rate) or rate <= 0:
            raise ConfigError(f"algorithm: learning_rate = {rate!r}: expected a number above 0")


@dataclass(frozen=True, kw_only=True)
class ResidualSettings(PPOSettings):
    """As those of PPO, and how much a correction may change."""

    correct_steering: float
    correct_speed: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self.of_machine("{}")
        if self.learner.action != "throttle" or self.learner.drive_range is not None:
            raise ConfigError("learner: corrections have action: throttle and no drive_range: they have own limits")

    def of_machine(self, machine: str, share: float = 1.0) -> Correction:
        """The correction of a machine, TRAL JSON; of its limits with a share of that of the speed."""
        return Correction(machine=machine, steering=self.correct_steering, speed=share * self.correct_speed)


LIMITS = (1.0, 0.7, 0.5)
"""Shares of the limit of a corrected speed with which the last network of a training is driven, until none is lost."""


@dataclass(frozen=True, kw_only=True)
class StartedSettings(PPOSettings):
    """As those of PPO, and how it goes on from a policy, whose own are learner, layers and activation."""

    critic_first: int

    def __post_init__(self) -> None:
        super().__post_init__()
        if not is_number(self.critic_first, whole=True) or self.critic_first < 0:
            raise ConfigError(f"critic_first = {self.critic_first!r}: expected a whole number, 0 or more")
        if self.normalize_inputs:
            raise ConfigError("normalize_inputs: expected false: the policy knows its inputs as they are")


def settings_for(request: TrainRequest, path: Path | None = None) -> ReinforcementSettings:
    """The hyper-parameters for a request, see `read_settings`.

    Raises:
        PolicyFileError: the policy to begin with cannot be read.
        ConfigError: it corrects a machine, or a setting is not allowed.
    """
    if request.start is None:
        return reinforcement_settings(request.algo, request.scenarios, path)
    network = start.network_to_begin_with(request.start)
    settings = read_settings(StartedSettings, "ppo_from", path)
    layers = tuple(len(bias) for _, bias in network.layers[:-1])
    return replace(settings, learner=network.learner, layers=layers, activation=network.activation)


def reinforcement_settings(algo: str, scenarios: tuple[str, ...], path: Path | None = None) -> ReinforcementSettings:
    """The hyper-parameters of an algorithm for some families, see `read_settings`."""
    kinds: dict[str, type[ReinforcementSettings]] = {"ppo": PPOSettings, "residual": ResidualSettings}
    settings = read_settings(kinds.get(algo, ReinforcementSettings), algo, path)
    return replace(settings, learner=sees_detections(settings.learner, scenarios))


def train(run: TrainingRun) -> None:
    """Train until the time or the steps are used up. The best network is in the folder of the run then.

    Raises:
        ConfigError: Stable-Baselines3 does not take the hyper-parameters.
    """
    torch.set_num_threads(1)
    venv = _cars(run)
    model = _model(run, venv)
    state = run.kept()
    if state is not None:
        _load(model, state)
    elif isinstance(run.settings, PPOSettings):
        if run.request.start is not None:
            start.begin_with(model, start.network_to_begin_with(run.request.start))
        start.explore(model, run.settings.noise)
    # A resumed training goes on with courses of its own, not with those that it began with.
    venv.seed(run.request.first_seed(len(run.curve.points)))
    try:
        model.learn(_FOREVER, callback=_Callback(run, _machine_text(run)), log_interval=None)
    finally:
        venv.close()


def _cars(run: TrainingRun) -> VecEnv:
    request, settings = run.request, run.settings
    # A machine that drives is Python: with it two processes are faster than two threads, without it they are not.
    shares = min(request.nthread, settings.cars) if isinstance(settings, ResidualSettings) else 1
    venv = make_vec_env(
        settings.cars,
        seed=request.first_seed(),
        processes=shares,
        nthread=request.nthread if shares == 1 else 1,
        scenario=request.scenario,
        randomization=request.levels,
        task=dict(settings.task),
        anywhere=settings.anywhere,
        **settings.learner.record(),
    )
    if isinstance(settings, ResidualSettings):
        machine = MachinePolicy(library.load(request.machine_name))
        venv.env_method("correct", machine, settings.correct_steering, settings.correct_speed, indices=0)
    inputs, reward = settings.normalize_inputs, settings.normalize_reward
    if not (inputs or reward):
        return venv
    gamma = settings.algorithm.get("gamma", 0.99)
    return VecNormalize(venv, norm_obs=inputs, norm_reward=reward, gamma=gamma, clip_obs=math.inf)


def _machine_text(run: TrainingRun) -> str | None:
    if not isinstance(run.settings, ResidualSettings):
        return None
    return tral_json.dumps(library.load(run.request.machine_name))


def _model(run: TrainingRun, venv: VecEnv) -> Any:
    settings: ReinforcementSettings = run.settings
    kind = SAC if run.request.algo == "sac" else PPO
    board = str(run.folder / "tensorboard") if importlib.util.find_spec("tensorboard") else None
    policy = {
        "net_arch": list(settings.layers),
        "activation_fn": ACTIVATIONS[settings.activation],
        **settings.policy,
    }
    try:
        model = kind(
            "MlpPolicy",
            venv,
            policy_kwargs=policy,
            seed=run.request.seed,
            device="cpu",
            tensorboard_log=board,
            **_algorithm(run),
        )
    except (TypeError, ValueError, AssertionError) as error:
        raise ConfigError(f"settings of {run.request.algo}: Stable-Baselines3 says: {error}") from error
    if board is None:
        # SB3's own logger that writes nothing makes a folder all the same.
        model.set_logger(Logger(folder=None, output_formats=[]))
    return model


def _algorithm(run: TrainingRun) -> dict[str, Any]:
    """The arguments of the settings; the learning rate of PPO falls with the share of the training that is done.

    SB3 knows the share of its steps that is done, but those of a training have no end.
    """
    settings: ReinforcementSettings = run.settings
    if not isinstance(settings, PPOSettings):
        return dict(settings.algorithm)
    rate, last = settings.algorithm["learning_rate"], settings.last_rate
    return {**settings.algorithm, "learning_rate": lambda _: rate * falling(run.share, last)}


class _Callback(BaseCallback):
    """Counts, tells, validates, and ends the training."""

    def __init__(self, run: TrainingRun, machine: str | None) -> None:
        super().__init__()
        self._run, self._machine, self._before = run, machine, run.steps
        self._outcomes: deque[bool] = deque(maxlen=RECENT)
        self._episodes = 0

    def _on_training_start(self) -> None:
        """Drive what the training begins with, unless that knows nothing."""
        run = self._run
        if isinstance(run.settings, StartedSettings | ResidualSettings) and not run.curve.points:
            self._validate()

    def _on_step(self) -> bool:
        run = self._run
        if isinstance(run.settings, StartedSettings):
            start.let_actor_learn(self.model, run.steps >= run.settings.critic_first)
        for info, done in zip(self.locals["infos"], self.locals["dones"], strict=True):
            if done:
                self._outcomes.append(bool(info["is_success"]))
                self._episodes += 1
        run.steps = self._before + self.num_timesteps
        if self.n_calls % 8 == 0:
            run.tell(self._success)
        if run.is_over or run.is_validation_due:
            self._validate()
        return not run.is_over

    @property
    def _success(self) -> float | None:
        return float(np.mean(self._outcomes)) if self._outcomes else None

    def _validate(self) -> None:
        settings: ReinforcementSettings = self._run.settings
        about = {"algorithm": self._run.request.algo}
        network = network_of_model(self.model, settings.learner, provenance=about)
        figures = {"success": self._success, "episodes": self._episodes, "loss": None}
        if isinstance(settings, ResidualSettings):
            self._validate_correction(network, settings, figures)
        else:
            self._run.validate(network, figures)
        self._run.keep(_state(self.model))

    def _validate_correction(self, network: Network, settings: ResidualSettings, figures: dict[str, Any]) -> None:
        """Drive a validation with a correction; the last one with smaller limits of the speed, too, if it loses drives.

        With a smaller limit, a daring network was faster than a careful one, see docs/learning_experiments.md.
        """
        assert self._machine is not None
        for share in LIMITS if self._run.is_over else LIMITS[:1]:
            correction = settings.of_machine(self._machine, share)
            told = figures if share == 1.0 else {**figures, "correct_speed": correction.speed}
            score = self._run.validate(replace(network, correction=correction), told)
            if not self._run.loses_drives(score):
                break


def _state(model: Any) -> dict[str, Any]:
    """What a later training needs to go on; the replay buffer of SAC is not among it."""
    optimizers = {name: each.state_dict() for name, each in _optimizers(model).items()}
    state: dict[str, Any] = {"policy": model.policy.state_dict(), "optimizers": optimizers}
    normalize = model.get_vec_normalize_env()
    if normalize is not None:
        returns = normalize.ret_rms
        state["returns"] = [float(returns.mean), float(returns.var), float(returns.count)]
        if normalize.norm_obs:
            inputs = normalize.obs_rms
            state["inputs"] = [torch.from_numpy(inputs.mean), torch.from_numpy(inputs.var), float(inputs.count)]
    if getattr(model, "log_ent_coef", None) is not None:
        state["log_ent_coef"] = model.log_ent_coef.detach()
    return state


def _load(model: Any, state: Mapping[str, Any]) -> None:
    try:
        model.policy.load_state_dict(state["policy"])
        for name, optimizer in _optimizers(model).items():
            optimizer.load_state_dict(state["optimizers"][name])
        normalize = model.get_vec_normalize_env()
        if normalize is not None:
            returns = normalize.ret_rms
            mean, var, returns.count = state["returns"]
            returns.mean, returns.var = np.float64(mean), np.float64(var)
            if normalize.norm_obs:
                mean, var, count = state["inputs"]
                inputs = normalize.obs_rms
                inputs.mean, inputs.var, inputs.count = mean.numpy(), var.numpy(), count
        if "log_ent_coef" in state:
            model.log_ent_coef.data.copy_(state["log_ent_coef"])
    except (KeyError, RuntimeError, ValueError) as error:
        raise ConfigError(f"--resume: the checkpoint does not fit: {error}") from error


def _optimizers(model: Any) -> dict[str, Any]:
    if not hasattr(model, "actor"):
        return {"policy": model.policy.optimizer}
    found = {"actor": model.actor.optimizer, "critic": model.critic.optimizer}
    return found if model.ent_coef_optimizer is None else found | {"entropy": model.ent_coef_optimizer}
