"""What counts as progress, gates, success; on plans small enough to do by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env import task
from tral_env.arrays import ALONE
from tral_env.config import CarConfig, TaskConfig
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, Segment
from tral_env.course.plan import Plan


def plan(**changes: object) -> Plan:
    """Ten metres along x, a gate of 0.8 m at 5 m, plain walls 2 m apart from 1 to 4 m."""
    x = np.linspace(0.0, 10.0, 101)
    values: dict[str, object] = {
        "box_position": np.zeros((0, 3)),
        "box_yaw": np.zeros(0),
        "box_size": np.zeros((0, 3)),
        "box_kind": np.zeros(0, np.int64),
        "route": np.stack([x, 0 * x], axis=1),
        "start": np.zeros(3),
        "gate_pose": np.array([[5.0, 0.0, 0.0]]),
        "gate_width": np.array([0.8]),
        "gate_id": np.zeros(1, np.int64),
        "straights": np.array([[1.0, 0.0, 0.0, 3.0, 2.0]]),
    }
    return Plan(**{**values, **changes})  # type: ignore[arg-type]


def track(*plans: Plan) -> task.Track:
    track = task.empty_track(len(plans))
    for row, one in enumerate(plans):
        task.lay(track, row, one)
    return track


def locate(track: task.Track, x: float, y: float, segment: int) -> tuple[float, float, int]:
    s, lateral, found = task.locate(track, np.array([0]), np.array([[x, y]]), np.array([segment]))
    return float(s[0]), float(lateral[0]), int(found[0])


def test_the_place_on_a_straight_route_is_x_and_left_is_positive() -> None:
    s, lateral, segment = locate(track(plan()), 3.14, 0.2, 30)
    assert s == pytest.approx(3.14)
    assert lateral == pytest.approx(0.2)
    assert segment == 31


def test_a_car_cannot_jump_to_a_far_part_of_its_route() -> None:
    s, _, _ = locate(track(plan()), 9.0, 0.0, 10)
    assert s == pytest.approx(1.6)


def corner(width: float, *turns: str) -> Plan:
    """Legs of 8 m joined by turns, in corridors of one width."""
    legs = [Segment(length=8.0, width=width, then=turn) for turn in turns]
    return build_plan(Course(name="corner", segments=(*legs, Segment(length=8.0, width=width))))


@pytest.mark.parametrize("width", [1.6, 2.6, 4.0, 6.0])
def test_a_car_that_cuts_a_corner_is_found_again_behind_it(width: float) -> None:
    around, inner = track(corner(width, "left")), width / 2 - 0.15  # m from the inner wall
    ahead = [(x, inner) for x in np.arange(1.0, 8.0 - inner, 0.03)]
    ahead += [(8.0 - inner, y) for y in np.arange(inner, 7.0, 0.03)]
    segment = 0
    for x, y in ahead:
        s, lateral, segment = locate(around, x, y, segment)
        assert lateral <= inner / 0.8 + 0.03
    assert s == pytest.approx(8.0 - 1.0 - 0.9 + 0.45 * np.pi + y - 0.9, abs=0.01)


def test_a_car_beside_the_leg_that_comes_back_stays_on_its_own() -> None:
    wide, narrow = Segment(length=8.0, width=2.6, then="left"), Segment(length=8.0, width=1.6)
    course = Course(name="u", segments=(wide, Segment(length=2.4, width=1.6, then="left"), narrow))
    u = track(build_plan(course))
    segment = 0
    for x in np.arange(1.0, 7.0, 0.03):  # 1.25 m from its own leg, 1.15 m from the one that comes back
        s, lateral, segment = locate(u, x, 1.25, segment)
        assert (s, lateral) == (pytest.approx(x - float(u.route[0, 0, 0])), pytest.approx(1.25))


def test_routes_of_unlike_lengths_live_side_by_side() -> None:
    short = plan(route=np.array([[0.0, 0.0], [0.1, 0.0]]), gate_pose=np.zeros((0, 3)), gate_width=np.zeros(0))
    both = track(short, plan())
    assert both.length.tolist() == pytest.approx([0.1, 10.0])
    assert both.gates.tolist() == [0, 1]
    s, _, _ = task.locate(both, np.array([0]), np.array([[3.0, 0.0]]), np.array([0]))
    assert s[0] == pytest.approx(0.1)


def test_a_gate_at_the_start_of_a_ring_is_passed_at_the_end_of_the_lap() -> None:
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0], [0.0, 0.0]])
    ring = plan(route=corners, gate_pose=np.array([[0.0, 0.0, 0.0]]))
    assert ring.gate_s.tolist() == pytest.approx([14.0])


def test_laps_make_one_long_route_with_the_gates_of_each_lap() -> None:
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0], [0.0, 0.0]])
    ring = plan(route=corners, gate_pose=np.array([[2.0, 0.0, 0.0]]), laps=3)
    laps = track(ring)
    assert laps.length.tolist() == pytest.approx([42.0])
    assert laps.gates.tolist() == [3]
    assert laps.gate_s[0].tolist() == pytest.approx([2.0, 16.0, 30.0])


def cross(before: tuple[float, float], after: tuple[float, float], passed: int = 0) -> tuple[bool, bool]:
    through, missed = task.cross_gates(
        track(plan()), np.array([before]), np.array([after]), np.array([after[0]]), np.array([passed])
    )
    return bool(through[0]), bool(missed[0])


def test_a_gate_is_passed_between_its_posts() -> None:
    assert cross((4.99, 0.39), (5.01, 0.39)) == (True, False)


def test_a_gate_is_missed_outside_its_posts() -> None:
    assert cross((4.99, 0.41), (5.01, 0.41)) == (False, True)


def test_a_gate_is_missed_backwards() -> None:
    assert cross((5.01, 0.0), (4.99, 0.0), passed=1) == (False, True)


def test_a_gate_is_missed_the_second_time_through_it() -> None:
    assert cross((4.99, 0.0), (5.01, 0.0), passed=1) == (False, True)


def test_backwards_outside_the_posts_counts_for_nothing() -> None:
    assert cross((5.01, 0.41), (4.99, 0.41)) == (False, False)


def test_a_car_that_stands_before_a_gate_has_neither_passed_nor_missed() -> None:
    assert cross((4.5, 0.0), (4.6, 0.0)) == (False, False)


def test_the_gate_line_ends_with_its_reach() -> None:
    assert cross((4.99, 3.1), (5.01, 3.1)) == (False, False)


def clearance(x: float, y: float, yaw: float = 0.0) -> tuple[float, float]:
    left, right = task.wall_clearance(track(plan()), np.array([[x, y, yaw]]), CarConfig())
    return float(left[0]), float(right[0])


def test_clearance_is_measured_from_the_side_ultrasonics() -> None:
    assert clearance(2.0, 0.3) == pytest.approx((0.6, 1.2))


def test_clearance_is_perpendicular_also_when_the_car_is_turned() -> None:
    left, right = clearance(2.0, 0.0, np.radians(10))
    ahead, aside = 0.129 * np.sin(np.radians(10)), 0.1 * np.cos(np.radians(10))
    assert left == pytest.approx(1.0 - ahead - aside)
    assert right == pytest.approx(1.0 + ahead - aside)


def test_there_is_no_clearance_off_the_plain_stretches() -> None:
    assert np.isnan(clearance(0.5, 0.0)).all()
    assert np.isnan(clearance(2.0, 0.0, np.pi)).all()


@given(
    x=st.floats(-1.0, 5.0) | st.sampled_from([0.871, 1.0, 3.871, 4.0]),
    y=st.floats(-1.2, 1.2),
    yaw=st.floats(-4.0, 4.0) | st.sampled_from([0.0, np.arccos(0.7), np.pi]),
    wheelbase=st.sampled_from([0.02, 0.258, 3.0]),
)
def test_a_car_alone_has_the_clearance_of_a_row(x: float, y: float, yaw: float, wheelbase: float) -> None:
    crossing = np.array([[1.0, 0.0, 0.0, 3.0, 2.0], [2.0, 1.0, -np.pi / 2, 2.0, 1.5]])
    course, pose, car = track(plan(straights=crossing)), np.array([[x, y, yaw]]), CarConfig(wheelbase=wheelbase)
    among = task.wall_clearance(course, pose, car)
    assert np.array(task.wall_clearance(course, pose, car, ALONE)).tobytes() == np.concatenate(among).tobytes()


def test_the_time_limit_is_that_of_a_slow_walk_and_ten_seconds() -> None:
    assert task.time_limit(np.array([12.0]), TaskConfig()).tolist() == pytest.approx([50.0])


def outcome(**changes: np.ndarray) -> task.Outcome:
    yes_no = {name: np.array([False]) for name in ("gate", "success", "failure")}
    return task.Outcome(**({"advance": np.zeros(1), "steering_change": np.zeros(1)} | yes_no | changes))


@pytest.mark.parametrize(
    ("changes", "name", "earned"),
    [
        ({"advance": np.array([0.02])}, "progress", 0.02),
        ({"gate": np.array([True])}, "gate", 1.0),
        ({"success": np.array([True])}, "success", 5.0),
        ({"failure": np.array([True])}, "failure", -2.0),
        ({"steering_change": np.array([2.0])}, "steering", -0.04),
    ],
)
def test_each_term_counts_its_own_and_the_reward_adds_them(changes: dict, name: str, earned: float) -> None:
    terms = task.reward_terms(outcome(**changes), TaskConfig())
    assert {key: float(values[0]) for key, values in terms.items()} == {
        **dict.fromkeys(task.REWARD_TERMS, 0.0),
        "time": -0.005,
        name: earned,
    }
    assert task.reward(terms).tolist() == pytest.approx([earned - 0.005])


def test_the_terms_are_added_in_their_order_to_the_last_bit() -> None:
    rng = np.random.default_rng(0)
    n, config = 1000, TaskConfig()
    flags = {name: rng.random(n) < 0.2 for name in ("gate", "success", "failure")}
    drawn = outcome(advance=rng.normal(0, 0.01, n), steering_change=rng.normal(0, 0.3, n), **flags)
    whole = (
        config.progress_reward * drawn.advance
        + config.gate_reward * drawn.gate
        + config.success_reward * drawn.success
        + config.failure_reward * drawn.failure
        - config.steering_cost * drawn.steering_change**2
        - config.time_cost
    )
    np.testing.assert_array_equal(task.reward(task.reward_terms(drawn, config)), whole)
