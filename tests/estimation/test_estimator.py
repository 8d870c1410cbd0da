"""From readings to an estimate of the car."""

import math

import pytest
from readings import Feed, one_state, two_states

from tral_env.interface import CORE_LAYOUT
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.estimator import Estimator
from tral_fsm.estimation.readings import Readings


class TestEstimator:
    def test_it_takes_the_columns_of_the_contract(self) -> None:
        assert CORE_LAYOUT.names == Readings._fields
        row = [0.01 * k for k in range(len(Readings._fields))]
        r = Readings._make(row)
        ranges_and_ages = (r.ultrasonic_left, r.ultrasonic_front, r.ultrasonic_right,
                           r.ultrasonic_left_age, r.ultrasonic_front_age, r.ultrasonic_right_age)  # fmt: skip
        assert (*ranges_and_ages, r.distance, r.speed) == tuple(row[:8])
        assert (r.gate_age, r.marker_age, r.steering, r.throttle) == (row[12], row[17], row[18], row[19])
        estimator = Estimator()
        estimator.update(row)
        estimate = estimator.update(row)
        ranges = (estimate.left.range, estimate.front.range, estimate.right.range)
        assert (*ranges, estimate.distance, estimate.speed) == (*row[:3], row[6], row[7])
        assert (estimate.gate.age, estimate.marker.age) == (row[12], row[17])

    def test_a_reading_is_new_when_it_did_not_just_grow_older(self) -> None:
        estimator, news = Estimator(), []
        for age in (10.0, 10.0, 0.065, 0.0775, 0.09, 0.065, 0.0775):
            row = CORE_LAYOUT.missing(1)[0]
            row[CORE_LAYOUT.names.index("ultrasonic_left_age")] = age
            news.append(estimator.update(row.tolist()).left.new)
        assert news == [False, False, True, False, False, True, False]

    def test_a_sonars_interval_is_that_between_its_firings(self) -> None:
        estimator = Estimator()
        for age in (0.065, 0.0775, 0.09, 0.1025, 0.115, 0.0525):
            row = CORE_LAYOUT.missing(1)[0]
            row[CORE_LAYOUT.names.index("ultrasonic_left_age")] = age
            estimate = estimator.update(row.tolist())
        # the second reading comes five ticks later, and is one tick fresher
        assert estimate.left.interval == pytest.approx(5 * 0.0125 + 0.0125)

    def test_a_straight_way_is_reckoned_straight(self) -> None:
        estimator = Estimator()
        for k in range(11):
            estimate = estimator.update(CORE_LAYOUT.pack({"distance": 0.1 * k, "speed": 0.5}, 1)[0].tolist())
        assert estimate.pose == pytest.approx((1.0, 0.0, 0.0))

    def test_a_pose_seen_from_here_and_back_is_the_same(self) -> None:
        estimate = CarEstimate(x=1.0, y=2.0, yaw=math.pi / 2)
        assert estimate.from_here((1.0, 3.0, math.pi / 2)) == pytest.approx((1.0, 0.0, 0.0))
        assert estimate.to_reckoning((1.0, 0.0, 0.0)) == pytest.approx((1.0, 3.0, math.pi / 2))

    def test_reverse_counts_backwards_once_the_car_has_stood(self) -> None:
        bench = two_states({"type": "Timer", "seconds": 100})
        bench.tick(distance=0.0, speed=0.0, throttle=-0.3)
        bench.tick(distance=0.1, speed=0.3, throttle=-0.3)
        assert bench.estimate.x == pytest.approx(-0.1)


class TestCorners:
    def test_a_turn_out_of_the_corridor_forgets_its_walls_though_no_range_comes_in_meanwhile(self) -> None:
        estimator, feed = Estimator(), Feed()
        for k in range(30):
            estimate = estimator.update(feed.row(left=0.8, right=1.0, distance=0.04 * k, speed=1.0))
        assert estimate.left_wall.known
        known = []
        while estimate.yaw < math.radians(60.0):
            k += 1
            estimate = estimator.update(feed.row(steering=1.0, distance=0.04 * k, speed=1.0))
            known.append(
                (round(math.degrees(estimate.yaw)) > 38, estimate.left_wall.known or estimate.right_wall.known)
            )
        assert {still for beyond, still in known if not beyond} == {True}
        assert {still for beyond, still in known if beyond} == {False}


class TestAxis:
    """A near gate tells which way the corridor leads."""

    @pytest.mark.parametrize(
        ("axis_deg", "distance", "believed"),
        [(21.0, 1.5, False), (23.0, 1.5, True), (-40.0, 1.5, True), (23.0, 2.5, False), (91.0, 1.5, False)],
        ids=["askew", "too far off", "to the other side", "far away", "across"],
    )
    def test_it_mends_a_wrong_direction_of_the_corridor(self, axis_deg: float, distance: float, believed: bool) -> None:
        bench = one_state(type="Motor", throttle=0.1)
        gate = {"gate_id": 0.0, "gate_x": distance, "gate_y": 0.0, "gate_heading": math.radians(axis_deg)}
        for _ in range(5):
            assert bench.estimate.heading == 0.0  # fewer images tell nothing
            bench.tick(**gate, gate_age=0.0)
        expected = -axis_deg if believed else 0.0
        assert math.degrees(bench.estimate.heading) == pytest.approx(expected, abs=0.01)


class TestSteering:
    """One offset and one gain, learnt from walls and gates, whatever the state."""

    def test_walls_teach_the_trim_and_the_driver_steers_by_it(self) -> None:
        bench = one_state(type="Motor", throttle=0.2)
        for k in range(60):  # it drifts to the left of straight ahead
            y = 0.5 * 0.1 * (0.04 * k) ** 2
            steering, _ = bench.tick(left=0.8 - y, right=0.8 + y, distance=0.04 * k, speed=0.5)
        assert bench.estimator.steering_offset < -0.03
        assert steering == bench.estimate.steering_offset == bench.estimator.steering_offset

    def test_a_given_trim_is_no_part_of_what_is_learnt(self) -> None:
        bench = one_state(type="Motor", throttle=0.2, steering=0.2, steering_trim=0.1)
        bench.tick()
        bench.estimator.steering_offset, bench.estimator.steering_gain = -0.03, 0.8
        assert bench.tick()[0] == pytest.approx(0.2 / 0.8 + 0.1 - 0.03)
        assert bench.estimator.steering_offset == -0.03
