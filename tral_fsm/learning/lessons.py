"""Cars that a network drives while a machine says at each decision what it would do."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Flags
from tral_env.errors import ConfigError
from tral_env.interface import CORE_LAYOUT, STEERING, THROTTLE
from tral_env.learned import Chart, Network, Values
from tral_env.learner import Actuation, LearnerConfig, LearnerView, inverse
from tral_env.speed_control import SPEED_PER_THROTTLE, THROTTLE_DEAD
from tral_env.vector_env import TralCorridorVectorEnv
from tral_fsm.definition import packaged
from tral_fsm.definition.machine import MachineDefinition, machines_within
from tral_fsm.evaluation.stuck import StuckWatch
from tral_fsm.learning.guard import Guard
from tral_fsm.learning.run import RECENT
from tral_fsm.learning.student import Samples
from tral_fsm.learning.teacher_settings import TeacherSettings
from tral_fsm.policies.chart_view import ChartView, input_names
from tral_fsm.runtime.policy import MachinePolicy

_SPEED = CORE_LAYOUT.column("speed")


def chart_of(machine: MachineDefinition, learner: LearnerConfig) -> Chart:
    """The state chart of a machine, its root first, for a network that follows it.

    Raises:
        ConfigError: a state gives a trim of the steering, of which the estimates of the network will know nothing.
    """
    states_within = (state for each in machines_within(machine, packaged.load) for state in each.states)
    trimmed = [state for state in states_within if getattr(state, "steering_trim", 0.0)]
    if trimmed:
        raise ConfigError(
            f"state {trimmed[0].id!r} of the machine that teaches has a steering_trim, and a student learns the trim "
            "of its car while it drives: set steering_trim to 0, or train with --plain"
        )
    states = (str(machine.root), *(str(state.id) for state in machine.states if state.id != machine.root))
    return Chart(states=states, inputs=input_names(states, learner.detections))


class Charted:
    """The state chart of the network in each of n cars, beside the machine that teaches it."""

    def __init__(self, chart: Chart, machine: MachinePolicy, settings: TeacherSettings, n: int) -> None:
        """Begin.

        Args:
            chart: that of the machine, see `chart_of`.
            machine: the teacher.
            settings: the hyper-parameters.
            n: number of cars.
        """
        self._machine, self._view = machine, ChartView(chart.states, settings.learner.detections, n)
        definition = machine.definition
        place = chart.states.index
        self._place = np.array([place(str(state.id)) for state in definition.states])
        """Of each state of the machine: its place in the chart."""
        self._index = np.argsort(self._place)
        """Of each state of the chart: its place in the machine."""
        self._leads = np.zeros((len(self._place), len(self._place)), bool)
        """Whether a transition leads from a state of the chart to another one."""
        for transition in definition.transitions:
            self._leads[place(str(transition.source)), place(str(transition.target))] = True
        self._differs = np.zeros(n, np.int64)
        """(n,) decisions for which network and machine have been in different states."""
        self._patience = settings.state_decisions

    def inputs(self, rows: NDArray[np.intp]) -> Values:
        """What the network sees beside the readings, (k, m)."""
        return self._view.inputs(rows, self._machine.estimates)

    def answers(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """The machine's states in some cars, (k,)."""
        states: NDArray[np.intp] = self._place[self._machine.active_indices[rows]]
        return states

    def enter(self, rows: NDArray[np.intp], states: NDArray[np.intp]) -> None:
        """Let the states (k,) that a network chose be active in some cars.

        Where it takes a transition before the machine does, the machine takes it, too: from now on it answers for that
        state. Where both are in different states for long, the network is put into that of the machine.
        """
        now, was = self.answers(rows), self._view.active[rows]
        early = (states != now) & (now == was) & self._leads[was, states]
        self._machine.go_to(rows[early], self._index[states[early]])
        now = np.where(early, states, now)
        self._differs[rows] = np.where(states == now, 0, self._differs[rows] + 1)
        lost = self._differs[rows] > self._patience
        self._differs[rows[lost]] = 0
        self._view.enter(rows, np.where(lost, now, states), self._machine.estimates)

    def reset(self, rows: Flags) -> None:
        """Begin episodes in the cars of `rows` (n,)."""
        self._view.reset(rows)
        self._differs[rows] = 0


class Lessons:
    """Cars that drive while the machine watches each of them."""

    def __init__(
        self,
        env: TralCorridorVectorEnv,
        machine: MachinePolicy,
        settings: TeacherSettings,
        chart: Chart | None,
        seed: int,
    ) -> None:
        """Begin.

        Args:
            env: cars with plain readings, decisions of one tick and without autoreset.
            machine: the teacher.
            settings: the hyper-parameters.
            chart: the state chart that the network follows; None: it has no states.
            seed: of the first course; row i begins with seed + i.
        """
        n = env.num_envs
        self._env, self._machine, self._learner = env, machine, settings.learner
        self._view, self._actuation = LearnerView(settings.learner, n), Actuation(settings.learner, n)
        self._charted = None if chart is None else Charted(chart, machine, settings, n)
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
            self._decide(network, told, due, samples)
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

    def _decide(self, network: Network, told: Values, due: Flags, samples: Samples) -> None:
        """Let the network decide for the cars that are due, and keep what the machine answers."""
        inputs, answers = self._view.observation()[due], self._answers(told)[due]
        states = np.zeros(len(inputs), np.intp)
        if self._charted is None:
            actions = network.actions(inputs)
        else:
            rows = np.flatnonzero(due)
            inputs, states = np.concatenate([inputs, self._charted.inputs(rows)], axis=1), self._charted.answers(rows)
            actions, wanted = network.decided(inputs)
            self._charted.enter(rows, np.where(self._taught[due], states, wanted))
        self._wanted[due] = self._actuation.wanted(actions)
        knows = self._knows()[due]
        samples.add(inputs[knows], answers[knows], states[knows])
        self._guard.watch(due, np.where(knows, np.abs(actions - answers)[:, STEERING], 0.0))
        self._hand_over()

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
        if self._charted is not None:
            self._charted.reset(rows)
        self._actuation.reset(rows)
        self._machine.reset_rows(rows)
        self._stuck.reset(rows)
        self._guard.reset(rows)
        self._hand_over()

    @property
    def success(self) -> float | None:
        """Share of the latest episodes of the network that arrived; None before the first."""
        return float(np.mean(self.outcomes)) if self.outcomes else None
