"""What a learner remembers of gates, signs and posts while its car drives on."""

import math
from collections.abc import Mapping

import numpy as np
import pytest

from tral_env.geometry import TRACK_M, curvature
from tral_env.interface import CORE_LAYOUT, MAX_AGE_S
from tral_env.learner import LearnerConfig, LearnerView
from tral_env.vector_env import TralCorridorVectorEnv

CONFIG = LearnerConfig(observation="features", memory=True, decision_hz=20)
GATE = {"gate_id": 3, "gate_x": 3.0, "gate_y": 0.5, "gate_heading": 0.2, "gate_age": 0.0}
POST = {"marker_id": 6, "marker_x": 3.0, "marker_y": 1.0, "marker_heading": 0.2, "marker_age": 0.0}
SIGN = {"marker_id": 41, "marker_x": 4.0, "marker_y": -1.0, "marker_heading": 0.1, "marker_age": 0.0}
AGAIN = 1e-4
"""A new detection differs from the one before, m."""


class Car:
    """A car whose readings are made by hand, and what it remembers."""

    def __init__(self, **values: float) -> None:
        self.view, self.values = LearnerView(CONFIG, 1), dict(values)
        self.view.reset(np.array([True]), CORE_LAYOUT.pack(self.values, 1))

    def read(self, **values: float) -> "Car":
        """Read some new values, and the old ones again, until a frame is kept."""
        self.values |= values
        for _ in range(CONFIG.interval_ticks):
            self.view.update(CORE_LAYOUT.pack(self.values, 1))
        return self

    def see_twice(self, detection: Mapping[str, float]) -> "Car":
        """See something in two images."""
        nudged = {name: value + AGAIN * name.endswith("_x") for name, value in detection.items()}
        return self.read(**nudged).read(**detection)

    def told(self, kind: str) -> dict[str, float]:
        """What the car remembers of a gate, sign or post, in m and s."""
        names = self.view.memory_names
        row = dict(zip(names, self.view.observation()[0, -len(names) :].tolist(), strict=True))
        scale = {"x": 5.0, "y": 2.0, "age": MAX_AGE_S}
        named = {name.removeprefix(f"{kind}_"): value for name, value in row.items() if name.startswith(kind)}
        return {name: value * scale.get(name, 1.0) for name, value in named.items()}


def place(told: Mapping[str, float]) -> tuple[float, float]:
    return told["x"], told["y"]


def near(*values: float) -> object:
    return pytest.approx(values, abs=1e-3)


def test_a_car_that_stands_remembers_what_it_saw() -> None:
    told = Car().see_twice(GATE).told("gate")
    assert place(told) == near(3.0, 0.5)
    assert (told["sin"], told["cos"]) == near(math.sin(0.2), math.cos(0.2))
    assert (told["age"], told["seen"]) == near(0.0, 1.0)


def test_nothing_is_told_before_two_images_agree() -> None:
    car = Car().read(**GATE)
    assert car.told("gate") == {"x": 0, "y": 0, "age": MAX_AGE_S, "sin": 0, "cos": 0, "seen": 0}
    assert car.read(gate_x=3.0 + AGAIN).told("gate")["seen"] == 1.0


@pytest.mark.parametrize("values", [{"marker_id": 42}, {"marker_y": 1.0}])
def test_a_marker_that_a_single_image_shows_elsewhere_moves_nothing(values: dict[str, float]) -> None:
    told = Car().see_twice(SIGN).read(**values).told("sign")
    assert place(told) == near(4.0, -1.0)
    assert (told["left"], told["right"], told["straight"]) == (0.0, 1.0, 0.0)


def test_what_lies_ahead_comes_nearer_and_falls_behind() -> None:
    car = Car().see_twice(GATE)
    assert place(car.read(distance=1.0).told("gate")) == near(2.0, 0.5)
    assert place(car.read(distance=4.0).told("gate")) == near(-1.0, 0.5)


def test_in_reverse_gear_it_comes_back() -> None:
    car = Car().see_twice(GATE).read(throttle=-0.5)
    assert place(car.read(distance=1.0).told("gate")) == near(4.0, 0.5)
    assert place(car.read(throttle=0.5).read(distance=2.0).told("gate")) == near(3.0, 0.5)


@pytest.mark.parametrize("steering", [-0.5, 0.6])
def test_on_a_circle_it_turns_the_other_way(steering: float) -> None:
    bend = curvature(steering)
    car, turn = Car(steering=steering).see_twice(GATE), math.copysign(math.pi / 2, steering)
    for share in np.linspace(0.0, 1.0, 100)[1:]:
        # the sensor counts the way of the left wheel, which runs on another circle
        car.read(distance=share * turn / bend * (1 - bend * TRACK_M / 2))
    told = car.told("gate")
    # after a quarter of the circle the car stands at (r, r), turned by a quarter
    x, y = 3.0 - abs(1 / bend), 0.5 - 1 / bend
    assert place(told) == near(*((y, -x) if steering > 0 else (-y, x)))
    assert math.atan2(told["sin"], told["cos"]) == pytest.approx(0.2 - turn, abs=1e-3)


def test_an_image_tells_where_things_were_when_it_was_exposed() -> None:
    car = Car(speed=1.0).see_twice(GATE | {"gate_age": 0.1})
    assert place(car.told("gate")) == near(2.9, 0.5)
    assert car.told("gate")["age"] == pytest.approx(0.1)


def test_it_lasts_ten_seconds() -> None:
    car = Car().see_twice(GATE)
    for _ in range(199):
        car.read()
    assert car.told("gate")["age"] == pytest.approx(9.95)
    assert car.told("gate")["seen"] == 1.0
    assert car.read().told("gate")["seen"] == 0.0


@pytest.mark.parametrize(("marker", "side"), [(6, "left"), (7, "right")])
def test_a_single_post_of_a_gate_is_told_with_its_side(marker: int, side: str) -> None:
    car = Car().see_twice(POST | {"marker_id": marker})
    assert place(car.told(f"{side}_post")) == near(3.0, 1.0)
    assert {name for name in ("gate", "sign", "left_post", "right_post") if car.told(name)["seen"]} == {f"{side}_post"}


def test_two_posts_in_turn_are_both_remembered() -> None:
    """Of two posts at the same distance now one is the nearest, now the other."""
    left, right = POST | {"marker_id": 6.0}, POST | {"marker_id": 7.0, "marker_y": -0.5}
    car = Car()
    for nudge in (0.0, AGAIN):
        for post in (left, right):
            car.read(**post | {"marker_x": post["marker_x"] + nudge})
    assert place(car.told("left_post"))[1] == pytest.approx(1.0, abs=1e-3)
    assert place(car.told("right_post"))[1] == pytest.approx(-0.5, abs=1e-3)


def test_a_post_that_is_seen_later_leaves_the_sign_where_it_is() -> None:
    car = Car().see_twice(SIGN).see_twice(POST)
    assert place(car.told("sign")) == near(4.0, -1.0)
    assert car.told("sign")["age"] == pytest.approx(0.1)


def test_an_episode_begins_with_nothing() -> None:
    car = Car().see_twice(GATE)
    car.view.reset(np.array([True]), CORE_LAYOUT.pack({}, 1))
    assert car.told("gate")["seen"] == 0.0


def test_a_reset_of_no_car_changes_nothing() -> None:
    car = Car().see_twice(GATE)
    before = car.view.observation()
    car.view.reset(np.array([False]), CORE_LAYOUT.pack({}, 1))
    assert np.array_equal(car.view.observation(), before)
    assert place(car.read(distance=1.0).told("gate")) == near(2.0, 0.5)


def test_a_row_remembers_what_a_car_alone_does_bit_for_bit() -> None:
    n, rng = 3, np.random.default_rng(0)
    env = TralCorridorVectorEnv(n, autoreset_mode="Disabled", scenario=("gates", "crossing"), randomization="hard")
    observation, _ = env.reset(seed=3)
    together, alone = LearnerView(CONFIG, n), [LearnerView(CONFIG, 1) for _ in range(n)]
    together.reset(np.ones(n, bool), observation)
    for row, view in enumerate(alone):
        view.reset(np.array([True]), observation[row : row + 1])
    for tick in range(240):
        observation = env.step(np.column_stack([rng.uniform(-0.3, 0.3, n), np.full(n, 0.3)]))[0]
        moved = None if tick < 160 else np.array([True, False, True])
        together.update(observation, moved)
        for row, view in enumerate(alone):
            if moved is None or moved[row]:
                view.update(observation[row : row + 1])
        if tick == 120:
            together.reset(np.array([False, True, False]), observation)
            alone[1].reset(np.array([True]), observation[1:2])
    env.close()
    assert np.array_equal(together.observation(), np.concatenate([view.observation() for view in alone]))
    seen = [k - len(together.memory_names) for k, name in enumerate(together.memory_names) if name.endswith("_seen")]
    assert together.observation()[:, seen].any()


def test_it_stands_once_behind_the_frames() -> None:
    view = LearnerView(LearnerConfig(observation="features", history=4, memory=True), 1)
    assert view.size == 4 * len(view.frame_names) + len(view.memory_names)
    assert not any(name.startswith(("gate", "sign")) for name in view.frame_names)


@pytest.mark.parametrize("values", [{"observation": "readings"}, {"detections": False}])
def test_without_features_of_detections_there_is_none(values: dict) -> None:
    view = LearnerView(LearnerConfig(**{"observation": "features"} | values, memory=True), 1)
    assert view.memory_names == ()
