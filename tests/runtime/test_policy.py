"""A machine as a policy: shapes, rows, episodes."""

from typing import ClassVar

import numpy as np
import pytest

from tral_env.errors import ConfigError, MachineError
from tral_env.interface import CORE_LAYOUT
from tral_fsm import MachinePolicy, load_machine, load_policy

SIZE = CORE_LAYOUT.size


def observation(n: int, **readings: float) -> np.ndarray:
    return CORE_LAYOUT.pack({"ultrasonic_right": 0.5, "ultrasonic_right_age": 0.065, **readings}, n)


def test_one_row_in_one_row_out() -> None:
    action = load_policy("wall").act(observation(1)[0])
    assert action.shape == (2,)
    assert action.dtype == np.float32


def test_n_rows_in_n_rows_out() -> None:
    policy = load_policy("wall")
    policy.reset(3)
    action = policy.act(observation(3))
    assert action.shape == (3, 2)
    assert (action == action[0]).all()


def test_a_row_does_not_depend_on_the_others() -> None:
    rng = np.random.default_rng(3)
    rows = rng.uniform(0.2, 1.0, (50, 4, SIZE)).astype(np.float32)
    together, alone = load_policy("office"), load_policy("office")
    together.reset(4)
    for row in rows:
        assert (together.act(row)[2] == alone.act(row[2])).all()


def test_after_reset_it_drives_as_at_first() -> None:
    policy = load_policy("office")
    rows = [observation(1, distance=0.1 * k, speed=0.5, ultrasonic_front=3 - 0.1 * k) for k in range(40)]
    first = [policy.act(row).tolist() for row in rows]
    policy.reset(1)
    assert [policy.act(row).tolist() for row in rows] == first


def test_a_distance_that_falls_begins_a_new_episode_in_that_row_alone() -> None:
    policy = load_policy("corridor")
    policy.reset(2)
    policy.predict(observation(2, ultrasonic_front=0.5, ultrasonic_front_age=0.0, ultrasonic_right=6.0, distance=3.0))
    assert policy.active_states == ["turn right", "turn right"]
    policy.predict(observation(2, distance=np.array([3.0, 0.0])))
    assert policy.active_states == ["turn right", "follow"]


def test_predict_has_the_signature_of_stable_baselines() -> None:
    policy = load_policy("wall")
    action, state = policy.predict(observation(2), state=None, episode_start=np.array([True, True]), deterministic=True)
    assert action.shape == (2, 2)
    assert state is None


class TestTheNumberOfCarsOfPredict:
    CORNER: ClassVar[dict[str, float]] = {
        "ultrasonic_front": 0.5, "ultrasonic_front_age": 0.0, "ultrasonic_right": 6.0, "ultrasonic_right_age": 0.0,
    }  # fmt: skip

    def turning(self) -> MachinePolicy:
        policy = load_policy("corridor")
        policy.predict(observation(2, **self.CORNER))
        assert policy.active_states == ["turn right", "turn right"]
        return policy

    def test_in_the_middle_of_a_drive_another_number_is_refused_and_the_cars_drive_on(self) -> None:
        policy = self.turning()
        for start in (None, np.array([True, False, True])):
            with pytest.raises(ConfigError, match=r"expected \(2, .*call reset\(n\)"):
                policy.predict(observation(3), episode_start=start)
        assert policy.active_states == ["turn right", "turn right"]

    def test_where_every_car_begins_an_episode_the_number_may_change(self) -> None:
        policy = self.turning()
        action, _ = policy.predict(observation(3), episode_start=np.array([True] * 3))
        assert action.shape == (3, 2)
        assert policy.active_states == ["follow"] * 3

    def test_after_a_reset_the_next_call_tells_the_number(self) -> None:
        policy = self.turning()
        policy.reset(2)
        assert policy.predict(observation(3))[0].shape == (3, 2)

    def test_what_is_no_observation_changes_nothing(self) -> None:
        policy = load_policy("corridor")
        with pytest.raises(ConfigError, match="an image"):
            policy.predict(np.zeros((4, 160, 3), np.uint8))
        assert policy.active_states == ["follow"]


def test_episode_start_restarts_those_rows_alone() -> None:
    policy = MachinePolicy(load_machine("corridor"))
    policy.reset(2)
    corner = {
        "ultrasonic_front": 0.5,
        "ultrasonic_front_age": 0.0,
        "ultrasonic_right": 6.0,
        "ultrasonic_right_age": 0.0,
    }
    policy.predict(observation(2, **corner))
    assert policy.active_states == ["turn right", "turn right"]
    policy.predict(observation(2), episode_start=np.array([False, True]))
    assert policy.active_states == ["turn right", "follow"]


def test_it_says_which_clearance_it_wants() -> None:
    policy = load_policy("wall")
    policy.act(observation(1))
    assert policy.wanted_clearance.tolist() == [[-1.0, 0.6]]


def test_a_state_without_a_wall_wants_no_clearance() -> None:
    policy = load_policy("gate_scurve")
    for _ in range(3):
        policy.act(observation(1, gate_id=0, gate_x=3.0, gate_age=0.05))
    assert policy.active_states == ["gate"]
    assert np.isnan(policy.wanted_clearance).all()


def test_the_trace_tells_of_the_first_car() -> None:
    fired = []
    policy = load_policy("gate", fired.append)
    policy.reset(2)
    for _ in range(2):
        policy.act(observation(2, gate_id=0, gate_x=3.0, gate_age=0.05))
    assert [transit.transition for transit in fired] == ["gate seen, follow"]


@pytest.mark.parametrize("rows", [np.array([True]), np.array([0, 1]), np.array([[True, False]])])
def test_rows_to_reset_are_one_truth_value_for_each_car(rows: np.ndarray) -> None:
    policy = load_policy("wall")
    policy.reset(2)
    with pytest.raises(MachineError, match=r"expected bool of shape \(2,\)"):
        policy.reset_rows(rows)


@pytest.mark.parametrize("n", [0, -1, "2", True, 1.5])
def test_a_number_of_cars_that_is_none_is_refused(n: object) -> None:
    with pytest.raises(ConfigError, match="number of cars = "):
        load_policy("wall").reset(n)  # type: ignore[arg-type]


class TestShadowing:
    """A machine whose car another policy drives; here that policy lets the car stand."""

    SHADOWED = np.array([True])

    def commands(self, policy: MachinePolicy, ticks: int) -> list[list[float]]:
        heard = {"ultrasonic_front": 3.0, "ultrasonic_front_age": 0.065, "ultrasonic_left_age": 0.065}
        standing = observation(1, ultrasonic_left=0.5, **heard)
        return [policy.act(standing)[0].tolist() for _ in range(ticks)]

    def test_its_answer_does_not_depend_on_commands_that_the_car_did_not_obey(self) -> None:
        shadow = load_policy("corners")
        shadow.shadow(self.SHADOWED)
        throttles = [throttle for _, throttle in self.commands(shadow, 160)]
        assert throttles[0] > 0.1
        assert {*throttles} == {throttles[0]}

    def test_a_driver_sums_up_what_the_car_lacks(self) -> None:
        throttles = [throttle for _, throttle in self.commands(load_policy("corners"), 60)]
        assert throttles[-1] > throttles[0] + 0.05

    def test_a_car_that_stands_does_not_stop_it_until_it_drives_itself(self) -> None:
        policy = load_policy("corners")
        policy.shadow(self.SHADOWED)
        self.commands(policy, 160)
        assert not policy.active_states[0].startswith("stopped")
        policy.shadow(~self.SHADOWED)
        self.commands(policy, 160)
        assert policy.active_states[0].startswith("stopped: told to drive for 1.2 s")
        policy.shadow(self.SHADOWED)
        assert not policy.active_states[0].startswith("stopped")

    def test_it_drives_after_a_reset_and_shadows_on_in_a_new_episode(self) -> None:
        policy = load_policy("corners")
        policy.shadow(self.SHADOWED)
        policy.reset_rows(np.array([True]))
        self.commands(policy, 160)
        assert not policy.active_states[0].startswith("stopped")
        policy.reset()
        self.commands(policy, 160)
        assert policy.active_states[0].startswith("stopped")

    def test_a_sensor_that_is_silent_stops_it(self) -> None:
        policy = load_policy("corners")
        policy.shadow(self.SHADOWED)
        for _ in range(60):
            policy.act(observation(1, ultrasonic_front_age=5.0))
        assert "silent" in policy.active_states[0]

    def test_rows_that_are_none_are_refused(self) -> None:
        with pytest.raises(
            MachineError, match=r"rows to shadow: got bool of shape \(2,\), expected bool of shape \(1,\)"
        ):
            load_policy("wall").shadow(np.array([True, False]))
