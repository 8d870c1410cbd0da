"""A network learns from a machine: the network drives, the machine says at each decision what it would do.

So the network sees the states into which it brings the car itself, with the right answer beside each. Source: Ross,
Gordon and Bagnell, A Reduction of Imitation Learning and Structured Prediction to No-Regret Online Learning, 2011
(DAgger).
"""

from __future__ import annotations

import math
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.checks import is_number
from tral_env.errors import ConfigError
from tral_env.interface import CORE_LAYOUT, STEERING, THROTTLE
from tral_env.learned import Network
from tral_env.learner import Actuation, LearnerConfig, LearnerView, inverse
from tral_env.speed_control import SPEED_PER_THROTTLE, THROTTLE_DEAD
from tral_env.vector_env import TralCorridorVectorEnv
from tral_fsm.evaluation.stuck import StuckWatch
from tral_fsm.learning.choices import check_size, positive, read_settings, sees_detections
from tral_fsm.learning.guard import Guard
from tral_fsm.learning.networks import ACTIVATIONS, as_network, falling, nn, perceptron, torch
from tral_fsm.learning.run import RECENT, TrainingRun
from tral_fsm.policies import load_machine_policy
from tral_fsm.runtime.policy import MachinePolicy

Flags = NDArray[np.bool_]
Values = NDArray[np.float32]
_SPEED = CORE_LAYOUT.column("speed")
LAST_RATE = 0.1
"""The learning rate falls to this share of it."""
KEPT_ROUNDS = 30
"""A checkpoint holds the decisions of so many rounds, 40 MB with the packaged settings; all of them would be 250 MB."""


@dataclass(frozen=True, kw_only=True)
class TeacherSettings:
    """Hyper-parameters; their meaning stands in settings/teacher.yaml."""

    learner: LearnerConfig
    cars: int
    layers: tuple[int, ...]
    activation: str
    learning_rate: float
    batch: int
    samples: int
    round_decisions: int
    round_updates: int
    teacher_rounds: int
    guarded: float
    help_above: float
    help_decisions: int
    average: float
    huber: float
    steering_weight: float
    stuck_s: float

    def __post_init__(self) -> None:
        check_size(self.cars, self.layers)
        if self.activation not in ACTIVATIONS:
            raise ConfigError(f"activation = {self.activation!r}: expected one of {', '.join(ACTIVATIONS)}")
        positive(self, "learning_rate", "batch", "samples", "round_decisions", "round_updates", "huber")
        positive(self, "steering_weight", "stuck_s", "teacher_rounds")
        positive(self, "average", below=1.0)
        positive(self, "help_above", "help_decisions")
        if not is_number(self.guarded) or not 0.0 <= self.guarded <= 1.0:
            raise ConfigError(f"guarded = {self.guarded!r}: expected 0 to 1")


def teacher_settings(scenarios: tuple[str, ...], path: Path | None = None) -> TeacherSettings:
    """The hyper-parameters for some families, see `read_settings`."""
    settings = read_settings(TeacherSettings, "teacher", path)
    return replace(settings, learner=sees_detections(settings.learner, scenarios))


class Samples:
    """The newest decisions with the machine's answers; the oldest make room."""

    def __init__(self, room: int, inputs: int) -> None:
        self._inputs, self._answers = np.zeros((room, inputs), np.float32), np.zeros((room, 2), np.float32)
        self.total = 0
        """Decisions so far, those that were forgotten included."""

    def add(self, inputs: Values, answers: Values) -> None:
        """Keep k decisions: (k, inputs), (k, 2)."""
        at = (self.total + np.arange(len(inputs))) % len(self._inputs)
        self._inputs[at], self._answers[at] = inputs, answers
        self.total += len(inputs)

    def newest(self, count: int) -> dict[str, torch.Tensor]:
        """The newest decisions, at most `count`, the oldest first."""
        count = min(count, self.total, len(self._inputs))
        at = (self.total - count + np.arange(count)) % len(self._inputs)
        inputs = self._inputs[at]
        if np.abs(inputs).max(initial=0.0) <= 1.0:  # features, not plain readings
            inputs = inputs.astype(np.float16)
        return {"inputs": torch.from_numpy(inputs), "answers": torch.from_numpy(self._answers[at])}

    def window(self, reserve: int) -> tuple[int, int]:
        """First and number of the decisions that stay while `reserve` more are added."""
        first = max(self.total + reserve - len(self._inputs), 0)
        return first, max(self.total - first, 1)

    def draw(self, window: tuple[int, int], size: int, rng: np.random.Generator) -> tuple[torch.Tensor, torch.Tensor]:
        """Some decisions of a window, drawn with replacement."""
        at = (window[0] + rng.integers(window[1], size=size)) % len(self._inputs)
        return torch.from_numpy(self._inputs[at]), torch.from_numpy(self._answers[at])


class Student:
    """The network that learns, and the running mean of it that drives."""

    def __init__(self, settings: TeacherSettings, machine: str, seed: int) -> None:
        torch.manual_seed(seed)
        self.settings, self._machine = settings, machine
        sizes = [LearnerView(settings.learner, 1).size, *settings.layers, 2]
        self._net, self._mean = (perceptron(sizes, settings.activation) for _ in range(2))
        self._mean.load_state_dict(self._net.state_dict())
        self._optimizer = torch.optim.Adam(self._net.parameters(), settings.learning_rate)
        self._seed, self._rng = seed, np.random.default_rng(seed)
        self._updates = 0
        weights = torch.tensor([settings.steering_weight, 1.0])
        self._weights = 2 * weights / weights.sum()

    def learn(self, samples: Samples, window: tuple[int, int], updates: int, share: float) -> float:
        """Take some steps of gradient descent; gives the mean loss.

        Args:
            samples: the decisions.
            window: see `Samples.window`.
            updates: number of steps.
            share: of the training that is done, in [0, 1].
        """
        settings = self.settings
        rate = settings.learning_rate * falling(share, LAST_RATE)
        for group in self._optimizer.param_groups:
            group["lr"] = rate
        total = 0.0
        for _ in range(updates):
            inputs, answers = samples.draw(window, settings.batch, self._rng)
            error = nn.functional.huber_loss(self._net(inputs), answers, reduction="none", delta=settings.huber)
            loss = (error * self._weights).mean()
            self._optimizer.zero_grad()
            loss.backward()
            self._optimizer.step()
            self._follow()
            total += loss.item()
        return total / updates

    def _follow(self) -> None:
        """Move the running mean towards the network."""
        self._updates += 1
        keep = min(self.settings.average, (1 + self._updates) / (10 + self._updates))
        with torch.no_grad():
            for mean, new in zip(self._mean.parameters(), self._net.parameters(), strict=True):
                mean.lerp_(new, 1 - keep)

    def network(self) -> Network:
        """The running mean as it is now."""
        provenance = {"algorithm": "teacher", "teacher": self._machine}
        return as_network(list(self._mean), self.settings.learner, output="clip", provenance=provenance)

    def state(self) -> dict[str, Any]:
        """What a later training needs to go on."""
        return {
            "net": self._net.state_dict(),
            "mean": self._mean.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "updates": self._updates,
        }

    def load(self, state: dict[str, Any]) -> None:
        """Go on from the state of an earlier training."""
        self._net.load_state_dict(state["net"])
        self._mean.load_state_dict(state["mean"])
        self._optimizer.load_state_dict(state["optimizer"])
        self._updates = state["updates"]
        self._rng = np.random.default_rng((self._seed, self._updates))


class Lessons:
    """Cars that drive while the machine watches each of them."""

    def __init__(
        self, env: TralCorridorVectorEnv, machine: MachinePolicy, settings: TeacherSettings, seed: int
    ) -> None:
        """Begin.

        Args:
            env: cars with plain readings, decisions of one tick and without autoreset.
            machine: the teacher.
            settings: the hyper-parameters.
            seed: of the first course; row i begins with seed + i.
        """
        n = env.num_envs
        self._env, self._machine, self._learner = env, machine, settings.learner
        self._view, self._actuation = LearnerView(settings.learner, n), Actuation(settings.learner, n)
        self._stuck = StuckWatch(n, settings.stuck_s)
        self._rng = np.random.default_rng(seed)
        self._wanted = np.zeros((n, 2))
        self._guard = Guard(n, settings.guarded, settings.help_above, settings.help_decisions)
        self._drawn = np.ones(n, bool)
        """(n,) cars that the machine drives in this round in any case."""
        self._taught = np.ones(n, bool)
        """(n,) the machine itself drives the car."""
        self._helped = np.ones(n, bool)
        """(n,) the machine has driven the car in this episode."""
        self.outcomes: deque[bool] = deque(maxlen=RECENT)
        """Success of the latest episodes that the network drove."""
        self.episodes = 0
        """Number of those episodes."""
        machine.reset(n)
        self._observation, _ = env.reset(seed=seed)
        self._view.reset(np.ones(n, bool), self._observation)

    def begin_round(self, taught_share: float) -> None:
        """Draw the cars that the machine drives, wherever they are on their courses.

        Args:
            taught_share: probability of each car.
        """
        self._drawn = self._rng.random(len(self._taught)) < taught_share
        self._hand_over()

    def _hand_over(self) -> None:
        """Let the machine drive the cars that are its now, and the network the others."""
        taught = self._drawn | self._guard.helps
        if (taught != self._taught).any():
            self._actuation.reset(taught & ~self._taught)
            self._taught = taught
            self._machine.shadow(~taught)

    def tick(self, network: Network, samples: Samples) -> int:
        """Drive for a tick; gives the number of decisions."""
        observation = self._observation
        told = self._machine.act(observation)
        due = self._view.due
        if due.any():
            inputs, answers = self._view.observation()[due], self._answers(told)[due]
            actions = network.actions(inputs)
            self._wanted[due] = self._actuation.wanted(actions)
            knows = self._knows()[due]
            samples.add(inputs[knows], answers[knows])
            self._guard.watch(due, np.where(knows, np.abs(actions - answers)[:, STEERING], 0.0))
            self._hand_over()
        driven = self._actuation.command(self._wanted, observation[:, _SPEED], ~self._taught)
        self._helped |= self._taught
        command = np.where(self._taught[:, None], told, driven)
        self._observation, _, terminated, truncated, info = self._env.step(command)
        self._view.update(self._observation)
        stuck = self._stuck.stuck(info["progress"] * self._env.world.track.length, info["time_s"])
        ended = terminated | truncated | stuck
        if ended.any():
            self._begin(ended, info["success"])
        return int(due.sum())

    def _knows(self) -> Flags:
        """(n,) the machine has an answer: it does not believe that its car is stuck, or a sensor dead."""
        return np.array([not state.startswith("stopped: ") for state in self._machine.active_states])

    def _answers(self, told: Values) -> Values:
        """The machine's commands (n, 2) as actions of the network."""
        drive = told[:, THROTTLE].astype(np.float64)
        if self._learner.action == "speed":
            target = self._machine.speed_target
            ahead = np.maximum((drive - THROTTLE_DEAD) * SPEED_PER_THROTTLE, 0.0)
            open_loop = np.where(drive < 0.0, drive * SPEED_PER_THROTTLE, ahead)
            drive = np.where(np.isnan(target), open_loop, target)
        return inverse(self._learner, told[:, STEERING], drive)

    def _begin(self, rows: Flags, success: Flags) -> None:
        """Begin new episodes."""
        alone = success[rows & ~self._helped].tolist()
        self.outcomes.extend(alone)
        self.episodes += len(alone)
        self._helped[rows] = False
        self._observation, _ = self._env.reset(options={"reset_mask": rows})
        self._view.reset(rows, self._observation)
        self._actuation.reset(rows)
        self._machine.reset_rows(rows)
        self._stuck.reset(rows)
        self._guard.reset(rows)
        self._hand_over()

    @property
    def success(self) -> float | None:
        """Share of the latest episodes of the network that arrived; None before the first."""
        return float(np.mean(self.outcomes)) if self.outcomes else None


def train(run: TrainingRun) -> None:
    """Train until the time or the steps are used up. The best network is in the folder of the run then.

    While the cars drive, the network learns from the decisions of the rounds before, in a thread of its own.
    """
    request, settings = run.request, run.settings
    torch.set_num_threads(1)
    student = Student(settings, request.machine_name, request.seed)
    samples = Samples(settings.samples, LearnerView(settings.learner, 1).size)
    done = _resume(run, student, samples)
    env = TralCorridorVectorEnv(
        settings.cars,
        autoreset_mode="Disabled",
        nthread=request.nthread,
        scenario=request.scenario,
        randomization=request.levels,
    )
    lessons = Lessons(env, load_machine_policy(request.machine_name), settings, request.first_seed(done))
    try:
        with ThreadPoolExecutor(1) as thread:
            _rounds(run, student, lessons, samples, thread, done)
    finally:
        env.close()


def _rounds(
    run: TrainingRun, student: Student, lessons: Lessons, samples: Samples, thread: ThreadPoolExecutor, done: int
) -> None:
    """Drive and learn, round by round; `done` were done before."""
    settings: TeacherSettings = run.settings
    reserve = settings.round_decisions * settings.cars
    ticks = settings.round_decisions * settings.learner.decision_ticks
    network, loss = student.network(), math.nan
    pending: Future[float] | None = None
    while not run.is_over:
        lessons.begin_round(max(1.0 - done / settings.teacher_rounds, 0.0))
        for tick in range(ticks):
            run.steps += lessons.tick(network, samples)
            if tick % 40 == 0:
                run.tell(lessons.success)
                if run.share >= 1.0:
                    break
        if pending is not None:
            loss, pending = pending.result(), None
            network = student.network()
        done += 1
        if run.is_validation_due or run.is_over:
            _validate(run, network, lessons, loss)
            run.keep(student.state() | {"rounds": done, "samples": samples.newest(KEPT_ROUNDS * reserve)})
        if samples.total:
            window = samples.window(2 * reserve)
            pending = thread.submit(student.learn, samples, window, settings.round_updates, run.share)
    if pending is not None:
        pending.result()


def _validate(run: TrainingRun, network: Network, lessons: Lessons, loss: float) -> None:
    """Drive the validation."""
    figures = {
        "success": lessons.success,
        "episodes": lessons.episodes,
        "loss": None if math.isnan(loss) else round(loss, 6),
    }
    run.validate(network, figures)


def _resume(run: TrainingRun, student: Student, samples: Samples) -> int:
    """Go on from the checkpoint, if the run does; gives the number of rounds that were done.

    Raises:
        ConfigError: the checkpoint is not one of this training.
    """
    state = run.kept()
    if state is None:
        return 0
    try:
        student.load(state)
        samples.add(state["samples"]["inputs"].numpy(), state["samples"]["answers"].numpy())
        return int(state["rounds"])
    except (KeyError, RuntimeError, ValueError, TypeError, AttributeError) as error:
        raise ConfigError(f"--resume: the checkpoint does not fit: {error}") from error
