"""The machine shadows cars that a network drives, and takes them over."""

import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")

from tral_env.errors import ConfigError
from tral_env.interface import CORE_LAYOUT
from tral_env.learned import Network
from tral_env.learner import LearnerView
from tral_env.vector_env import TralCorridorVectorEnv
from tral_fsm import load_machine, load_policy
from tral_fsm.formats import tral_json
from tral_fsm.learning.guard import Guard
from tral_fsm.learning.lessons import Charted, Lessons, chart_of
from tral_fsm.learning.student import Samples
from tral_fsm.learning.teacher_settings import TeacherSettings, teacher_settings

CARS = 2
SETTINGS = replace(teacher_settings(("straight",)), stuck_s=60.0)
INPUTS = LearnerView(SETTINGS.learner, 1).size


def answering(settings: TeacherSettings, drive: float) -> Network:
    """A network that always steers straight and drives so: -1 is a speed or a throttle of 0."""
    layers = [(np.zeros((2, INPUTS), np.float32), np.float32([0.0, drive]))]
    return Network(learner=settings.learner, layers=layers)


@pytest.fixture
def env() -> Iterator[TralCorridorVectorEnv]:
    cars = TralCorridorVectorEnv(CARS, autoreset_mode="Disabled", scenario="straight", randomization="none")
    yield cars
    cars.close()


@pytest.mark.parametrize("action", ["speed", "throttle"])
def test_a_network_that_stands_gets_the_same_answer_at_each_decision(env: TralCorridorVectorEnv, action: str) -> None:
    learner = replace(SETTINGS.learner, action=action, drive_range=(0.0, 1.0))
    settings = replace(SETTINGS, learner=learner)
    lessons, samples = Lessons(env, load_policy("wall"), settings, None, 0), Samples(1000, INPUTS)
    lessons.begin_round(0.0)
    decisions = sum(lessons.tick(answering(settings, -1.0), samples) for _ in range(160))
    assert decisions == samples.total == CARS * 40
    _, answers, _ = samples.draw((8, samples.total - 8), 500, np.random.default_rng(0))
    speeds = answers[:, 1].numpy()
    assert speeds.min() > -1.0
    assert speeds.max() - speeds.min() < 1e-6


def test_the_machine_drives_a_car_off_where_a_network_let_it_stand(env: TralCorridorVectorEnv) -> None:
    lessons, samples = Lessons(env, load_policy("wall"), SETTINGS, None, 0), Samples(1000, INPUTS)
    low, high = SETTINGS.learner.drives_from_to
    for taught_share in (0.0, 1.0):
        lessons.begin_round(taught_share)
        for _ in range(160):
            lessons.tick(answering(SETTINGS, (low + high) / (low - high)), samples)  # 0 m/s
    assert (env.world.info()["speed_mps"] > 0.3).all()


def test_the_network_learns_the_states_of_the_machine_and_follows_its_own() -> None:
    cars = TralCorridorVectorEnv(CARS, autoreset_mode="Disabled", scenario="corners", randomization="none")
    machine = load_policy("corners")
    chart = chart_of(machine.definition, SETTINGS.learner)
    wanted = 1
    bias = np.zeros(2 + len(chart.states), np.float32)
    bias[2 + wanted] = 1.0
    layers = [(np.zeros((len(bias), INPUTS + len(chart.inputs)), np.float32), bias)]
    network = Network(learner=SETTINGS.learner, layers=layers, chart=chart)
    samples = Samples(10_000, INPUTS + len(chart.inputs))
    lessons = Lessons(cars, machine, replace(SETTINGS, guarded=0.0), chart, 0)
    lessons.begin_round(1.0)  # the machine drives
    for _ in range(1200):
        lessons.tick(network, samples)
    inputs, _, states = (each.numpy() for each in samples.newest(2 * 300).values())
    names = list(chart.inputs)
    active = inputs[:, names.index(f"in_{chart.states[0]}") - len(names) :][:, : len(chart.states)].argmax(axis=1)
    assert set(states.tolist()) >= {0, 1}, "the machine did not turn"
    assert active[CARS:].tolist() == states[:-CARS].tolist()  # in which state the machine was at the decision before
    lessons.begin_round(0.0)
    for _ in range(16):
        lessons.tick(network, samples)
    inputs = samples.newest(2 * CARS)["inputs"].numpy()
    assert (inputs[:, names.index(f"in_{chart.states[wanted]}") - len(names)] == 1.0).all()
    assert {name.partition("/")[0] for name in machine.active_states} == {chart.states[wanted]}, "it did not follow"
    cars.close()


class TestAMachineWithATrim:
    """The driver of a machine adds the trim of its file to what it estimates; a student has no such file."""

    def test_a_trim_of_a_state_is_refused(self) -> None:
        machine = load_machine("corners")
        states = (machine.states[0], machine.states[1].model_copy(update={"steering_trim": 0.1}), *machine.states[2:])
        with pytest.raises(ConfigError, match=r"state 'corner' .* steering_trim to 0, or train with --plain"):
            chart_of(machine.model_copy(update={"states": states}), SETTINGS.learner)

    def test_so_is_one_of_a_machine_that_a_state_holds(self) -> None:
        inner = {
            "root": 0,
            "states": [{"id": 0, "type": "Motor", "throttle": 0.2, "steering_trim": 0.1, "final": True}],
        }
        outer = {"root": "a", "states": [{"id": "a", "type": "FSMState", "machine": inner, "final": True}]}
        with pytest.raises(ConfigError, match="state 0 of the machine that teaches has a steering_trim"):
            chart_of(tral_json.loads(json.dumps(outer)), SETTINGS.learner)


class TestTwoStates:
    """Network and machine are in different states of the chart: follow -> corner -> settle -> follow."""

    ROW = np.arange(1)

    def charted(self) -> Charted:
        self.machine = load_policy("corners")
        self.machine.act(CORE_LAYOUT.missing(1).astype(np.float32)[0])
        self.chart = chart_of(self.machine.definition, SETTINGS.learner)
        assert self.chart.states == ("follow", "corner", "settle")
        return Charted(self.chart, self.machine, replace(SETTINGS, state_decisions=3), 1)

    def active(self, charted: Charted) -> str:
        """State of the network, by its inputs."""
        names = list(self.chart.inputs)
        told = dict(zip(names, charted.inputs(self.ROW)[0].tolist(), strict=True))
        return next(state for state in self.chart.states if told[f"in_{state}"] == 1.0)

    def test_the_machine_takes_a_transition_that_the_network_takes_early(self) -> None:
        charted = self.charted()
        charted.enter(self.ROW, np.array([1]))
        assert self.active(charted) == "corner"
        assert charted.answers(self.ROW).tolist() == [1]

    def test_where_no_transition_leads_the_machine_stays_and_puts_the_network_right_in_the_end(self) -> None:
        charted = self.charted()
        states = []
        for _ in range(5):
            charted.enter(self.ROW, np.array([2]))
            states.append((self.active(charted), charted.answers(self.ROW).tolist()))
        assert states == [("settle", [0])] * 3 + [("follow", [0]), ("settle", [0])]

    def test_a_new_episode_begins_in_the_first_state(self) -> None:
        charted = self.charted()
        charted.enter(self.ROW, np.array([2]))
        charted.reset(np.ones(1, bool))
        assert self.active(charted) == "follow"


class TestGuard:
    def guard(self) -> Guard:
        return Guard(2, guarded=0.5, above=0.4, decisions=3)

    def after(self, errors: list[float]) -> list[list[bool]]:
        """Which of two cars the machine drives after each decision."""
        guard, helped = self.guard(), []
        for error in errors:
            guard.watch(np.ones(2, bool), np.full(2, error))
            helped.append(guard.helps.tolist())
        return helped

    def test_a_guarded_car_is_taken_over_when_its_mean_error_is_large_and_given_back(self) -> None:
        # the mean is 1 - 0.9^k: above 0.4 from the fifth error on
        helped = self.after([1.0] * 5 + [0.0] * 4)
        assert [first for first, _ in helped] == [False] * 4 + [True] * 3 + [False] * 2

    def test_a_car_without_a_guard_goes_on(self) -> None:
        assert not any(second for _, second in self.after([1.0] * 20))

    def test_small_errors_are_left_to_the_network(self) -> None:
        assert not any(first for first, _ in self.after([0.39] * 100))

    def test_an_episode_begins_without_errors(self) -> None:
        guard, both = self.guard(), np.ones(2, bool)
        for _ in range(5):
            guard.watch(both, np.ones(2))
        guard.reset(both)
        assert not guard.helps.any()
        guard.watch(both, np.ones(2))
        assert not guard.helps.any()


def test_the_machine_drives_on_where_a_guarded_network_errs(env: TralCorridorVectorEnv) -> None:
    settings = replace(SETTINGS, guarded=0.5, help_above=0.2, help_decisions=20)
    wrong = [(np.zeros((2, INPUTS), np.float32), np.float32([1.0, 0.0]))]
    lessons, samples = Lessons(env, load_policy("wall"), settings, None, 0), Samples(1000, INPUTS)
    lessons.begin_round(0.0)
    for _ in range(240):
        lessons.tick(Network(learner=settings.learner, layers=wrong), samples)
    progress = env.world.info()["progress"]
    assert progress[0] > progress[1] + 0.05
