"""A network that follows a state chart: it sees the estimate of its car, and answers which state comes next."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rows import row_among_others

from tral_env import policy_file
from tral_env.env import TralCorridorEnv
from tral_env.errors import ConfigError, PolicyFileError
from tral_env.interface import CORE_FIELDS
from tral_env.learned import Chart, Correction, LearnedPolicy, Network
from tral_env.learner import LearnerConfig, LearnerView
from tral_fsm import load_policy
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.estimator import Estimator
from tral_fsm.estimation.front_obstacle import FrontObstacle
from tral_fsm.estimation.wall_filter import WallEstimate
from tral_fsm.policies.chart_view import ChartView, input_names
from tral_fsm.policies.charted import ChartedPolicy

LEARNER = LearnerConfig(decision_hz=20, observation="features", history=2, action="speed")
STATES = ("follow", "turn", "stop")
CHART = Chart(states=STATES, inputs=input_names(STATES, detections=True))
SIZE = LearnerView(LEARNER, 1).size
INPUTS = SIZE + len(CHART.inputs)


def place(name: str) -> int:
    return SIZE + CHART.inputs.index(name)


def network(seed: int = 0, chart: Chart | None = CHART) -> Network:
    rng = np.random.default_rng(seed)
    sizes = [(16, INPUTS), (5, 16)]
    layers = [(rng.normal(0, s[1] ** -0.5, s).astype(np.float32), np.zeros(s[0], np.float32)) for s in sizes]
    return Network(learner=LEARNER, layers=layers, chart=chart)


def by_hand(weights: dict[tuple[int, str], float], biases: list[float]) -> Network:
    """A network of one layer: weights by answer (steering, drive, then the states) and input."""
    weight = np.zeros((5, INPUTS), np.float32)
    for (answer, name), value in weights.items():
        weight[answer, place(name)] = value
    return Network(learner=LEARNER, layers=[(weight, np.float32(biases))], chart=CHART)


def test_the_state_that_it_answers_is_active_from_the_next_decision_on() -> None:
    # follow -> turn -> stop -> stop: each state is asked for by the input that tells the one before
    after = {(2 + STATES.index(b), f"in_{a}"): 1.0 for a, b in (("follow", "turn"), ("turn", "stop"), ("stop", "stop"))}
    policy = ChartedPolicy(by_hand({**after, (0, "in_turn"): 0.5}, [0.0] * 5))
    env = TralCorridorEnv(scenario="straight")
    observation, _ = env.reset(seed=1)
    told = []
    for _ in range(3 * LEARNER.decision_ticks):
        command = policy.act(observation)
        told.append((policy.active_states[0], float(command[0])))
        observation, *_ = env.step(command)
    assert told[:: LEARNER.decision_ticks] == [("turn", 0.0), ("stop", 0.5), ("stop", 0.0)]
    policy.reset()
    assert policy.active_states == ["follow"]


def test_the_time_of_a_state_is_counted_from_its_begin() -> None:
    view, both = ChartView(STATES, True, 2), np.arange(2)
    later = [CarEstimate(time=1.0, arc_length=0.6), CarEstimate(time=1.0, arc_length=0.6)]
    view.enter(both, np.array([0, 1]), later)
    inputs = view.inputs(both, [CarEstimate(time=2.0, arc_length=1.2), CarEstimate(time=2.0, arc_length=1.2)])
    time, way = (CHART.inputs.index(f"since_{what}") for what in ("time", "way"))
    assert inputs[:, time] == pytest.approx([2.0 / 5, 1.0 / 5])  # the first car is in its first state still
    assert inputs[:, way] == pytest.approx([1.2 / 3, 0.6 / 3])
    view.reset(np.array([False, True]))
    assert view.active.tolist() == [0, 0]


PLACES = st.floats(-100, 100)
RANGES = st.floats(0, 6) | st.just(math.inf)


def walls(sign: float) -> st.SearchStrategy[WallEstimate]:
    known = {"range": st.floats(-1, 3), "x": PLACES, "y": PLACES, "lost": st.integers(0, 100), "moved": st.just(0)}
    return st.builds(WallEstimate, sign=st.just(sign), **known) | st.just(WallEstimate(sign))


DETECTIONS = st.builds(
    Detection,
    id=st.integers(-1, 50),
    x=PLACES,
    y=PLACES,
    heading=st.floats(-10, 10),
    age=st.floats(0, 10),
    opening=st.floats(0, 3) | st.just(math.nan),
)
ESTIMATES = st.builds(
    CarEstimate,
    direction=st.sampled_from([-1.0, 1.0]),
    left_wall=walls(1.0),
    right_wall=walls(-1.0),
    obstacle=st.builds(
        FrontObstacle,
        range=RANGES,
        first_range=RANGES,
        last_range=RANGES,
        streak=st.integers(0, 100),
        sums=st.tuples(st.floats(0, 100), PLACES, st.floats(0, 1e4), PLACES, PLACES),
    ),
    gate=DETECTIONS,
    guessed_gate=DETECTIONS,
    marker=DETECTIONS,
    time=st.floats(0, 200),
    arc_length=PLACES,
    x=PLACES,
    y=PLACES,
    yaw=st.floats(-20, 20),
    heading=st.floats(-math.pi / 4, math.pi / 4),
    steering_offset=st.floats(-0.25, 0.25),
    steering_gain=st.floats(0.8, 1.2),
)


@given(estimate=ESTIMATES, detections=st.booleans())
def test_every_input_has_a_name_and_lies_within_1(estimate: CarEstimate, detections: bool) -> None:
    inputs = ChartView(STATES, detections, 1).inputs(np.arange(1), [estimate])
    assert inputs.shape == (1, len(input_names(STATES, detections)))
    assert np.abs(inputs).max() <= 1.0


@pytest.mark.parametrize("scenario", ["crossing", "obstacles", "gates"])
def test_so_do_those_of_a_drive(scenario: str) -> None:
    env, machine = TralCorridorEnv(scenario=scenario, randomization="hard"), load_policy("office")
    observation, _ = env.reset(seed=4)
    view, estimator, seen = ChartView(STATES, True, 1), Estimator(), []
    for tick in range(1200):
        estimate = estimator.update(observation[: len(CORE_FIELDS)].tolist())
        view.enter(np.arange(1), np.array([tick // 100 % 3]), [estimate])
        seen.append(view.inputs(np.arange(1), [estimate])[0])
        observation, _, *ends, _ = env.step(machine.act(observation))
        if any(ends):
            break
    values = np.array(seen)
    assert np.abs(values).max() <= 1.0
    moving = {name for name, column in zip(CHART.inputs, values.T, strict=True) if np.ptp(column) > 0.05}
    assert moving >= {"left_wall_clearance", "right_wall_known", "heading", "sure", "obstacle_last_range", "since_way"}
    if scenario != "obstacles":
        assert moving >= {"marker_estimate_x", "marker_estimate_known"}


def test_a_row_among_others_is_driven_as_alone_also_when_rows_begin_anew() -> None:
    for together, alone in row_among_others(ChartedPolicy(network()), ChartedPolicy(network()), 3, "crossing"):
        assert together.active_states[1] == alone.active_states[0]


class TestFile:
    def test_it_drives_as_before(self, tmp_path: Path) -> None:
        policy_file.save(network(), tmp_path)
        policy, before = load_policy(tmp_path), ChartedPolicy(network())
        assert isinstance(policy, ChartedPolicy)
        assert policy.network.chart == CHART
        env = TralCorridorEnv(scenario="office")
        observation, _ = env.reset(seed=2)
        for _ in range(60):
            command = policy.act(observation)
            assert command.tolist() == before.act(observation).tolist()
            observation, *_ = env.step(command)

    def test_what_knows_no_estimate_refuses_it(self, tmp_path: Path) -> None:
        policy_file.save(network(), tmp_path)
        with pytest.raises(PolicyFileError, match=r"follows a state chart: load it with tral_fsm\.load_policy"):
            policy_file.load(tmp_path)
        with pytest.raises(ConfigError, match="the network follows a state chart"):
            LearnedPolicy(network())

    def test_a_network_without_a_chart_is_no_charted_policy(self) -> None:
        plain = Network(learner=LEARNER, layers=[(np.zeros((2, SIZE), np.float32), np.zeros(2, np.float32))])
        with pytest.raises(ConfigError, match="the network follows no state chart"):
            ChartedPolicy(plain)

    def changed(self, folder: Path, **chart: object) -> str:
        """What loading says of a file whose chart was changed."""
        return self.replaced(folder, "chart", asdict(CHART) | chart)

    def replaced(self, folder: Path, name: str, value: object) -> str:
        """What loading says of a file in which something else stands under a name."""
        path = policy_file.save(network(), folder)
        path.write_text(json.dumps(json.loads(path.read_text()) | {name: value}))
        with pytest.raises(PolicyFileError) as error:
            load_policy(folder)
        return str(error.value)

    def test_other_estimates_are_refused_with_what_differs(self, tmp_path: Path) -> None:
        inputs = [name.replace("since_way", "since_road") for name in CHART.inputs]
        said = self.changed(tmp_path, inputs=inputs)
        assert "made for other estimates: since_road, since_way: train it anew" in said
        assert str(tmp_path) in said
        assert "their order" in self.changed(tmp_path, inputs=[*CHART.inputs[1:], CHART.inputs[0]])

    @pytest.mark.parametrize(
        ("states", "says"),
        [
            ("follow", "chart: expected null, or an object with lists of states and inputs"),
            ([], "states of the chart: expected one name or more"),
            (["follow", "follow", "stop"], "each name may stand there once"),
            ([1, 2, 3], "states of the chart: expected one name or more"),
            (["follow", "turn"], r"layer 1 has weights"),
        ],
    )
    def test_states_that_are_none_are_refused(self, states: object, says: str, tmp_path: Path) -> None:
        assert says in self.changed(tmp_path, states=states)

    @pytest.mark.parametrize("chart", [True, 3, "follow", [], ["follow"], {}, {"states": ["follow"]}])
    def test_a_chart_that_is_none_is_refused(self, chart: object, tmp_path: Path) -> None:
        said = self.replaced(tmp_path, "chart", chart)
        assert "chart: expected null, or an object with lists of states and inputs" in said
        assert str(tmp_path / "policy.json") in said

    @pytest.mark.parametrize("correction", [True, 3, "wall", []])
    def test_a_correction_that_is_none_is_refused(self, correction: object, tmp_path: Path) -> None:
        assert "correction: expected null, or an object" in self.replaced(tmp_path, "correction", correction)


def test_a_network_follows_a_chart_or_corrects_a_machine() -> None:
    learner = LearnerConfig(observation="features")
    layers = [(np.zeros((5, LearnerView(learner, 1).size + len(CHART.inputs)), np.float32), np.zeros(5, np.float32))]
    with pytest.raises(ConfigError, match="not both"):
        Network(
            learner=learner,
            layers=layers,
            chart=CHART,
            correction=Correction(machine="", steering=0.1, speed=0.1),
        )
