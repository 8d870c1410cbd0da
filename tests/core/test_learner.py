"""What a learner sees of hand-made readings, and what its actions mean."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.errors import ConfigError
from tral_env.interface import CORE_LAYOUT, Layout
from tral_env.learner import Actuation, LearnerConfig, LearnerView, feature_names, inverse
from tral_env.speed_control import SpeedRegulator


def readings(**values: float) -> np.ndarray:
    return CORE_LAYOUT.pack(values, 1)


def features(config: LearnerConfig | None = None, **values: float) -> dict[str, float]:
    view = LearnerView(config or LearnerConfig(observation="features"), 1)
    view.reset(np.array([True]), readings(**values))
    return dict(zip(view.frame_names, view.observation()[0].tolist(), strict=True))


class TestFeatures:
    def test_a_range_is_scaled_and_tells_its_age_and_that_there_was_an_echo(self) -> None:
        seen = features(ultrasonic_left=1.5, ultrasonic_left_age=0.05)
        assert (seen["left_range"], seen["left_age"], seen["left_echo"]) == (-0.5, 0.25, 1.0)

    def test_no_echo_is_the_farthest_range_without_an_echo(self) -> None:
        seen = features(ultrasonic_front=6.0, ultrasonic_front_age=0.1)
        assert (seen["front_range"], seen["front_age"], seen["front_echo"]) == (1.0, 0.5, 0.0)

    def test_before_anything_was_measured_ages_are_1_and_nothing_is_seen(self) -> None:
        seen = features()
        assert {name for name, value in seen.items() if value == 1.0} == {
            "left_range", "front_range", "right_range", "left_age", "front_age", "right_age", "gate_age", "sign_age",
        }  # fmt: skip
        assert set(seen.values()) == {0.0, 1.0}

    def test_speed_and_command_are_told(self) -> None:
        seen = features(speed=0.5, steering=-0.25, throttle=0.75)
        assert (seen["speed"], seen["steering"], seen["throttle"]) == (0.25, -0.25, 0.75)

    def test_a_gate_is_told_by_place_axis_and_age(self) -> None:
        seen = features(gate_id=3, gate_x=2.0, gate_y=-0.5, gate_heading=math.pi / 6, gate_age=1.25)
        told = [seen[f"gate_{what}"] for what in ("x", "y", "age", "sin", "cos", "seen")]
        assert told == pytest.approx([0.4, -0.25, 0.25, 0.5, math.sqrt(0.75), 1.0], abs=1e-7)
        assert seen["sign_seen"] == 0.0

    @pytest.mark.parametrize(("marker", "turn"), [(40, "left"), (41, "right"), (42, "straight")])
    def test_a_turn_sign_is_told_by_place_age_and_turn(self, marker: int, turn: str) -> None:
        seen = features(marker_id=marker, marker_x=2.5, marker_y=1.0, marker_heading=0.0, marker_age=0.5)
        told = [seen[f"sign_{what}"] for what in ("x", "y", "age", "sin", "cos", "seen")]
        assert told == pytest.approx([0.5, 0.5, 0.1, 0.0, 1.0, 1.0])
        assert [seen[f"sign_{each}"] for each in ("left", "right", "straight")] == [
            float(each == turn) for each in ("left", "right", "straight")
        ]

    @pytest.mark.parametrize("values", [{"marker_id": 7, "marker_age": 0.1}, {"marker_id": 40, "marker_age": 5.0}])
    def test_a_post_of_a_gate_and_what_was_seen_long_ago_are_no_sign(self, values: dict) -> None:
        seen = features(marker_x=2.5, **values)
        assert [seen[name] for name in seen if name.startswith("sign_")] == [0, 0, 1, 0, 0, 0, 0, 0, 0]

    def test_detections_can_be_left_out(self) -> None:
        seen = features(LearnerConfig(observation="features", detections=False), gate_id=3, gate_age=0.0)
        assert tuple(seen) == feature_names(detections=False) == feature_names()[: len(seen)]
        assert not any(name.startswith(("gate", "sign")) for name in seen)

    def test_the_way_is_that_since_the_frame_before(self) -> None:
        config = LearnerConfig(observation="features", decision_hz=20, detections=False)
        view = LearnerView(config, 1)
        view.reset(np.array([True]), readings(distance=7.0))
        way = view.frame_names.index("way")
        assert view.observation()[0, way] == 0.0
        for tick in range(1, 9):
            view.update(readings(distance=7.0 + 0.0125 * tick))  # 1 m/s, and 2 m/s is 1
            if tick % 4 == 0:
                assert view.observation()[0, way] == pytest.approx(0.5, abs=1e-5)

    @given(st.integers(0, 2**32 - 1), st.booleans())
    def test_no_feature_leaves_its_bounds(self, seed: int, memory: bool) -> None:
        view = LearnerView(LearnerConfig(observation="features", history=3, memory=memory), 8)
        low, high = CORE_LAYOUT.space().low, CORE_LAYOUT.space().high
        rng = np.random.default_rng(seed)
        rows = rng.uniform(low, high, (5, 8, len(low))).astype(np.float32)
        rows[..., CORE_LAYOUT.column("distance")].sort(axis=0)
        view.reset(np.ones(8, bool), rows[0])
        for each in rows[1:]:
            view.update(each)
            assert np.abs(view.observation()).max() <= 1.0


class TestHistory:
    def plain(self, **options: float) -> LearnerView:
        """A view of one car whose only changing reading is the way."""
        return LearnerView(LearnerConfig(**options), 1)  # type: ignore[arg-type]

    def ways(self, view: LearnerView) -> list[float]:
        return view.observation().reshape(-1, CORE_LAYOUT.size)[:, CORE_LAYOUT.column("distance")].tolist()

    def test_at_a_reset_every_frame_is_the_first(self) -> None:
        view = self.plain(history=3)
        view.reset(np.array([True]), readings(distance=5.0))
        assert self.ways(view) == [5.0, 5.0, 5.0]

    @pytest.mark.parametrize(
        ("options", "ticks", "ways"),
        [
            ({"history": 3}, 5, [3, 4, 5]),
            ({"history": 3, "decision_hz": 20}, 12, [4, 8, 12]),
            ({"history": 3, "decision_hz": 20}, 4, [0, 0, 4]),
            ({"history": 3, "decision_hz": 10, "spacing_s": 0.05}, 16, [8, 12, 16]),
            ({"history": 3, "decision_hz": 20, "spacing_s": 0.1}, 20, [4, 12, 20]),
            ({"history": 2, "decision_hz": 10, "spacing_s": 0.15}, 16, [4, 16]),
        ],
    )
    def test_the_newest_frame_is_of_now_and_the_others_lie_their_spacing_behind(
        self, options: dict, ticks: int, ways: list[int]
    ) -> None:
        view = self.plain(**options)
        view.reset(np.array([True]), readings(distance=0.0))
        for tick in range(1, ticks + 1):
            view.update(readings(distance=tick))
        assert view.due.tolist() == [True]
        assert self.ways(view) == ways

    def test_with_a_growth_each_frame_lies_farther_behind_the_next_than_that_one_does(self) -> None:
        view = self.plain(history=5, growth=2.0)
        view.reset(np.array([True]), readings(distance=0.0))
        for tick in range(1, 21):
            view.update(readings(distance=tick))
        assert self.ways(view) == [20 - 15, 20 - 7, 20 - 3, 20 - 1, 20]

    def test_a_growth_that_is_no_whole_number_is_rounded_from_now_back(self) -> None:
        assert LearnerConfig(history=16, growth=1.2).ages == (72, 59, 48, 40, 32, 26, 21, 16, 13, 10, 7, 5, 4, 2, 1, 0)

    def test_a_car_whose_episode_ends_keeps_what_it_read_last(self) -> None:
        view = self.plain(history=2, decision_hz=10)
        view.reset(np.array([True]), readings(distance=0.0))
        for tick in range(1, 4):
            view.update(readings(distance=tick), ended=np.array([tick == 3]))
        assert self.ways(view) == [0.0, 3.0]

    def test_rows_are_reset_and_moved_by_themselves(self) -> None:
        view = LearnerView(LearnerConfig(history=2, decision_hz=40), 3)
        column = CORE_LAYOUT.column("distance")

        def at(*ways: float) -> np.ndarray:
            return CORE_LAYOUT.pack({"distance": np.array(ways)}, 3)

        view.reset(np.ones(3, bool), at(0, 0, 0))
        view.update(at(1, 1, 1))
        view.reset(np.array([False, True, False]), at(1, 9, 1))
        view.update(at(2, 10, 2), rows=np.array([True, True, False]))
        assert view.due.tolist() == [True, False, False]
        assert view.observation().reshape(3, 2, -1)[..., column].tolist() == [[0, 2], [9, 9], [0, 0]]

    def test_optional_groups_are_part_of_plain_frames_alone(self) -> None:
        layout = Layout.of(("imu",))
        assert LearnerView(LearnerConfig(history=4), 1, layout).size == 4 * layout.size
        assert LearnerView(LearnerConfig(observation="features"), 1, layout).size == len(feature_names())


class TestActions:
    def test_by_default_they_are_commands_as_they_are(self) -> None:
        given = np.array([[0.3, -1.7]])
        actuation = Actuation(LearnerConfig(), 1)
        assert np.array_equal(actuation.command(actuation.wanted(given), np.zeros(1)), given)

    def test_a_range_says_what_minus_one_and_one_are(self) -> None:
        actuation = Actuation(LearnerConfig(drive_range=(0.1, 0.4)), 3)
        wanted = actuation.wanted(np.array([[0.5, -1.0], [2.0, 0.0], [0.0, 1.0]]))
        assert wanted == pytest.approx(np.array([[0.5, 0.1], [1.0, 0.25], [0.0, 0.4]]))

    def test_a_speed_is_regulated_as_that_of_a_machine(self) -> None:
        actuation, alone = Actuation(LearnerConfig(action="speed", drive_range=(0.0, 1.0)), 2), SpeedRegulator()
        wanted = actuation.wanted(np.array([[0.0, -1.0], [0.1, 0.0]]))
        assert wanted.tolist() == [[0.0, 0.0], [0.1, 0.5]]
        for speed in (0.0, 0.2, 0.7):
            command = actuation.command(wanted, np.array([0.0, speed]))
            assert command[1].tolist() == [0.1, np.float32(alone.regulate(0.5, speed))]
            assert command[0].tolist() == [0.0, 0.0]

    def test_a_speed_below_0_is_a_throttle_in_reverse_but_for_a_small_one(self) -> None:
        actuation = Actuation(LearnerConfig(action="speed", drive_range=(-1.0, 1.0)), 3)
        wanted = actuation.wanted(np.array([[0.0, -0.66], [0.0, -0.2], [0.0, 0.0]]))
        assert wanted[:, 1].tolist() == pytest.approx([-0.66, 0.0, 0.0])
        command = actuation.command(wanted, np.zeros(3))
        assert command[:, 1].tolist() == pytest.approx([-0.66 / 2.64, 0.0, 0.0])

    def test_a_reset_row_regulates_as_at_first(self) -> None:
        actuation = Actuation(LearnerConfig(action="speed"), 2)
        wanted = actuation.wanted(np.zeros((2, 2)))
        first = actuation.command(wanted, np.zeros(2))
        actuation.command(wanted, np.zeros(2))
        actuation.reset(np.array([True, False]))
        again = actuation.command(wanted, np.zeros(2))
        assert again[0, 1] == first[0, 1]
        assert again[1, 1] > first[1, 1]

    @given(st.floats(-1, 1), st.floats(0.2, 1.4))
    def test_an_answer_becomes_the_action_that_means_it(self, steering: float, speed: float) -> None:
        config = LearnerConfig(action="speed", drive_range=(0.2, 1.4))
        action = inverse(config, np.array([steering]), np.array([speed]))
        assert Actuation(config, 1).wanted(action)[0] == pytest.approx([steering, speed], abs=1e-6)

    def test_an_answer_beyond_the_range_becomes_its_end(self) -> None:
        config = LearnerConfig(drive_range=(0.1, 0.4))
        assert inverse(config, np.array([0.0, 0.0]), np.array([-0.3, 0.9])).tolist() == [[0.0, -1.0], [0.0, 1.0]]


class TestRefusals:
    @pytest.mark.parametrize(
        ("values", "message"),
        [
            ({"decision_hz": 30}, r"2.66667 ticks of 1/80 s, .* expected 40 or 26.6666667"),
            ({"decision_hz": 0}, "decision_hz = 0: expected at least 1, at most 80"),
            ({"decision_hz": 1e-9}, "decision_hz = 1e-09: expected at least 1"),
            ({"decision_hz": 5e-324}, "expected at least 1"),
            ({"decision_hz": 10**400}, "expected at least 1"),
            ({"history": 256, "spacing_s": 10.0}, "204001 frames of a car would be kept, expected 4096 at most"),
            ({"decision_hz": 160}, "at most 80"),
            ({"decision_hz": "10"}, "decision_hz = '10'"),
            ({"decision_hz": math.nan}, "decision_hz = nan"),
            ({"history": 0}, "history = 0: expected a whole number, 1 to 256"),
            ({"history": 2.5}, "history = 2.5"),
            ({"history": True}, "history = True"),
            ({"spacing_s": 0.03}, r"2.4 ticks of 1/80 s, .* expected 0.025 or 0.0375 s"),
            ({"growth": 0.9}, "growth = 0.9: expected 1 to 2"),
            ({"history": 200, "growth": 1.2}, "4097 frames of a car would be kept, expected 4096 at most"),
            ({"spacing_s": 0.0}, "spacing_s = 0.0: expected 0.0125 to 10 s, or None"),
            ({"observation": "feature"}, "unknown observation 'feature': did you mean 'features'"),
            ({"action": "sped"}, "unknown action 'sped': did you mean 'speed'"),
            ({"drive_range": (0.4, 0.1)}, r"drive_range = \(0.4, 0.1\) with action='throttle': .* from -1 to 1"),
            ({"drive_range": (-1.1, 1.0), "action": "speed"}, "from -1 to 5"),
            ({"drive_range": 0.4}, "expected two numbers that rise"),
            ({"detections": 1}, "detections = 1: expected True or False"),
            ({"memory": None}, "memory = None: expected True or False"),
        ],
    )
    def test_a_value_that_cannot_be_is_told_with_what_is_allowed(self, values: dict, message: str) -> None:
        with pytest.raises(ConfigError, match=message):
            LearnerConfig(**values)

    def test_a_third_of_the_rate_is_a_whole_number_of_ticks(self) -> None:
        assert LearnerConfig(decision_hz=80 / 3).decision_ticks == 3

    def test_a_record_gives_the_configuration_again(self) -> None:
        config = LearnerConfig(decision_hz=20, history=4, action="speed", drive_range=(0.1, 1.0))
        assert LearnerConfig.of(config.record()) == config
        assert type(LearnerConfig(decision_hz=np.int64(20)).record()["decision_hz"]) is int  # type: ignore[arg-type]
        with pytest.raises(ConfigError, match="a learner has no 'histori': did you mean 'history'"):
            LearnerConfig.of({"histori": 3})
