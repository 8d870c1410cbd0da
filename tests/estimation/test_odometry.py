"""Dead reckoning."""

import math

import pytest
from readings import Feed

from tral_env.geometry import TRACK_M, curvature
from tral_env.se2 import relative
from tral_fsm.estimation.odometry import Odometry, OdometrySample
from tral_fsm.estimation.readings import Readings

TICK_S = 0.0125
FAST_MPS = 1e6
"""At this speed the tyres' scrub holds no wheel back."""


class Car:
    """Dead reckoning of a car whose wheels stand where its command says."""

    def __init__(self, steering: float = 0.0, offset: float = 0.0, gain: float = 1.0, throttle: float = 0.2) -> None:
        self.feed, self.odometry = Feed(), Odometry()
        self.offset, self.gain = offset, gain
        self.distance = 0.0
        self.drive(0.0, 200, steering=steering, throttle=throttle, speed=FAST_MPS)

    def drive(self, distance: float, ticks: int, **readings: float) -> OdometrySample:
        """Let the hall sensor count a distance [m] in equal steps."""
        for _ in range(ticks):
            self.distance += distance / ticks
            row = self.feed.row(distance=self.distance, **readings)
            self.odometry.update(Readings._make(row), self.offset, self.gain)
        return self.odometry.sample_before(0.0)


class TestCircle:
    """The hall sensor's magnets sit on the rear left wheel: on the inner circle of a left turn."""

    @pytest.mark.parametrize("steering", [1.0, -1.0, 0.5])
    def test_the_left_wheels_way_round_leads_back_to_the_start(self, steering: float) -> None:
        radius = 1.0 / curvature(steering)
        car = Car(steering)
        quarter = abs(2.0 * math.pi * (radius - TRACK_M / 2.0)) / 4.0
        sample = car.drive(quarter, 2000)
        assert sample[:3] == pytest.approx((abs(radius), radius, math.copysign(math.pi / 2.0, steering)), abs=2e-3)
        sample = car.drive(3.0 * quarter, 6000)
        assert sample[:3] == pytest.approx((0.0, 0.0, math.copysign(2.0 * math.pi, steering)), abs=4e-3)
        assert sample.arc_length == pytest.approx(2.0 * math.pi * abs(radius), abs=4e-3)
        assert sample.heading_change == sample.yaw

    def test_offset_and_gain_say_which_circle(self) -> None:
        sample = Car(0.6, offset=0.1, gain=0.8).drive(0.5, 500)
        k = 0.8 * curvature(0.5)
        way = 0.5 / (1.0 - k * TRACK_M / 2.0)
        assert (sample.arc_length, sample.yaw) == pytest.approx((way, k * way), abs=1e-6)

    def test_in_reverse_it_goes_back_on_the_same_circle(self) -> None:
        car = Car(0.5)
        car.drive(0.6, 300)
        car.drive(0.0, 1, speed=0.0, throttle=-0.2)
        sample = car.drive(0.6, 300, speed=FAST_MPS)
        assert sample[:5] == pytest.approx((0.0, 0.0, 0.0, 0.0, 0.0), abs=1e-3)


class TestSample:
    """A sample is of the moment in which a sensor fired: its pose and its sums."""

    def test_pose_and_sums_are_of_the_same_moment(self) -> None:
        car = Car()
        samples = [car.drive(0.0125, 1) for _ in range(40)]
        for back in (0, 4, 20):
            before = car.odometry.sample_before(back * TICK_S)
            assert before == samples[-1 - back]
            assert before.arc_length == pytest.approx(before.x) == pytest.approx(0.0125 * (40 - back))

    def test_an_older_image_has_a_shorter_way_behind_it(self) -> None:
        # images aged 0.05 s, then 0.25 s, a metre a second
        car = Car()
        car.drive(1.0, 80)
        first = car.odometry.sample_before(0.05)
        car.drive(0.5, 40)
        second = car.odometry.sample_before(0.25)
        assert second.arc_length - first.arc_length == pytest.approx(0.3)
        assert second.x - first.x == pytest.approx(0.3)

    def test_what_is_older_than_all_that_is_kept_is_the_oldest(self) -> None:
        car = Car()
        samples = [car.drive(0.01, 1) for _ in range(300)]
        assert car.odometry.sample_before(10.0) == samples[-128]


class TestNoise:
    """The doubt that driving adds: the variances of two ways add up, however often a sensor fires."""

    def test_of_a_circle(self) -> None:
        # the heading wanders by 0.01 rad in a metre; 1 mm of the way is doubtful in each turn of the wheels
        car = Car(0.5)
        before = car.odometry.sample_before(0.0)
        after = car.drive(0.5, 50)
        way, k = after.arc_length - before.arc_length, curvature(0.5)
        assert after.heading_noise(before) == pytest.approx(way * (1e-4 + 1e-3 * k * k), rel=1e-6)
        assert after.trim_noise(before) == pytest.approx(way * 1e-4, rel=1e-6)

    def test_of_wheels_that_move(self) -> None:
        # in the first tick they move by 0.0125 / 0.06 of a full lock, and the car by 1 cm
        car = Car()
        before = car.odometry.sample_before(0.0)
        after = car.drive(0.01, 1, steering=1.0)
        moved = 0.0125 / 0.06
        k = curvature(moved)
        way = 0.01 / (1.0 - k * TRACK_M / 2.0)
        lag = 0.7 * math.radians(22.0) / 0.258
        assert after.heading_noise(before) == pytest.approx(way * (1e-4 + 1e-3 * k * k + 0.04 * lag * lag), rel=1e-6)
        assert after.trim_noise(before) == pytest.approx(way * 1e-4 + 5 * (0.02 * moved) ** 2, rel=1e-6)

    def test_it_adds_up_and_asks_not_which_sample_is_the_later_one(self) -> None:
        car = Car()
        a = car.odometry.sample_before(0.0)
        b = car.drive(0.1, 10, steering=0.7)
        c = car.drive(0.3, 30, steering=-0.4)
        assert a.heading_noise(b) + b.heading_noise(c) == pytest.approx(a.heading_noise(c))
        assert a.trim_noise(b) + b.trim_noise(c) == pytest.approx(a.trim_noise(c))
        assert (b.heading_noise(a), b.trim_noise(a)) == (a.heading_noise(b), a.trim_noise(b))
        assert a.heading_noise(b) > 0.0 < a.trim_noise(b)


class TestCorrectHeading:
    """A heading that was wrong at a place turns the way to it and from it about that place."""

    def test_the_place_stays_and_what_came_after_turns_about_it(self) -> None:
        car = Car(0.5)
        car.drive(0.4, 40)
        then = car.odometry.sample_before(8 * TICK_S)
        now = car.odometry.sample_before(0.0)
        car.odometry.correct_heading(0.1, then.x, then.y)
        corrected = car.odometry.sample_before(8 * TICK_S)
        assert corrected == pytest.approx(then._replace(yaw=then.yaw + 0.1))
        assert relative(corrected[:3], car.odometry.sample_before(0.0)[:3]) == pytest.approx(
            relative(then[:3], now[:3])
        )
        here = car.odometry.x, car.odometry.y, car.odometry.yaw
        assert here == car.odometry.sample_before(0.0)[:3]

    def test_the_way_goes_on_in_the_corrected_direction(self) -> None:
        car = Car()
        car.drive(1.0, 80)
        car.odometry.correct_heading(math.pi / 2.0, 1.0, 0.0)
        assert car.drive(0.5, 40)[:3] == pytest.approx((1.0, 0.5, math.pi / 2.0))

    def test_corrections_add_up(self) -> None:
        car = Car(0.3)
        for turn in (0.1, -0.3, 0.2):
            car.drive(0.2, 20)
            car.odometry.correct_heading(turn, car.odometry.x, car.odometry.y)
        assert car.odometry.yaw == pytest.approx(car.odometry.heading_change)
