"""Dead reckoning tells how wrong it may be: as wrong as cars of the level "default" are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from tral_env.config import HallConfig
from tral_env.geometry import WHEELBASE_M, curvature
from tral_env.randomization import LEVELS
from tral_env.ros.msg.sensor import Imu, Odometry
from tral_env.ros.odometry import NOT_MEASURED, DeadReckoning
from tral_env.ros.readings import ReadingMessages

STEP_M = HallConfig().metres_per_tick
CARS = 4000


def driven(metres: float, steering: float = 0.0) -> Odometry:
    reckoning = DeadReckoning()
    for tick in range(round(metres / STEP_M) + 1):
        reckoning.update(tick * STEP_M, 1.0, steering, 0.3)
    return reckoning.message(0)


def square(covariance: list[float]) -> NDArray[np.float64]:
    return np.array(covariance).reshape(6, 6)


@pytest.mark.parametrize("steering", [0.0, 0.3])
def test_the_covariance_is_that_of_many_cars(steering: float) -> None:
    """Cars whose constants and ticks are drawn drive the way that the hall sensor counted; where are they?"""
    level, ticks, draw = LEVELS["default"], round(3.0 / STEP_M), np.random.default_rng(1)
    offset = np.radians(draw.uniform(*level.steering_offset_deg, CARS)) / WHEELBASE_M
    bend = curvature(steering) * draw.uniform(*level.lock_scale, CARS) + offset
    scale = draw.uniform(*level.wheel_radius_scale, CARS)
    x, y, yaw = np.zeros((3, CARS))
    for _ in range(ticks):
        missed = draw.random(CARS) < level.hall_miss_rate[0]
        doubled = draw.random(CARS) < level.hall_double_rate[0]
        way = STEP_M * scale * (1.0 + missed - doubled)
        x, y = x + way * np.cos(yaw + way * bend / 2), y + way * np.sin(yaw + way * bend / 2)
        yaw = yaw + way * bend
    told = square(list(driven(3.0, steering).pose.covariance))[np.ix_([0, 1, 5], [0, 1, 5])]
    assert np.sqrt(np.diag(told)) == pytest.approx(np.std([x, y, yaw], axis=1), rel=0.12, abs=0.01)


def test_a_car_that_has_not_moved_knows_its_place_to_half_a_tick() -> None:
    told = square(list(DeadReckoning().message(0).pose.covariance))
    assert told[0, 0] == pytest.approx(STEP_M**2 / 12)
    assert told[1, 1] == told[5, 5] == 0.0


def test_what_is_not_measured_says_so() -> None:
    message = driven(1.0)
    for covariance, unknown in ((message.pose.covariance, (2, 3, 4)), (message.twist.covariance, (1, 2, 3, 4))):
        assert [square(list(covariance))[each, each] for each in unknown] == [NOT_MEASURED] * len(unknown)


@pytest.mark.parametrize("steering", [0.0, -0.8])
def test_covariances_are_symmetric_and_positive(steering: float) -> None:
    message = driven(5.0, steering)
    for covariance in (message.pose.covariance, message.twist.covariance):
        found = square(list(covariance))
        assert np.array_equal(found, found.T)
        assert np.linalg.eigvalsh(found).min() >= -1e-9


def test_a_speed_of_zero_may_be_that_of_a_car_that_creeps() -> None:
    creeps = STEP_M / HallConfig().timeout_s
    assert square(list(DeadReckoning().message(0).twist.covariance))[0, 0] == pytest.approx(creeps**2 / 12)


def test_an_imu_without_orientation_says_so_and_tells_noise_and_bias_of_the_chip() -> None:
    readings = {f"imu_{what}_{axis}": 0.0 for what in ("gyro", "accel") for axis in "xyz"}
    (imu,) = (told.message for told in ReadingMessages().of(readings, 1) if isinstance(told.message, Imu))
    assert list(imu.orientation_covariance) == [-1.0, *[0.0] * 8]
    noise_dps, bias_dps = 0.01 * math.sqrt(41.0), 0.1
    gyro = math.radians(1.0) ** 2 * (noise_dps**2 + bias_dps**2)
    assert list(imu.angular_velocity_covariance) == pytest.approx([gyro, 0, 0, 0, gyro, 0, 0, 0, gyro])
    noise_g, bias_g = 300e-6 * math.sqrt(41.0), 0.03
    accel = 9.80665**2 * (noise_g**2 + bias_g**2)
    assert list(imu.linear_acceleration_covariance) == pytest.approx([accel, 0, 0, 0, accel, 0, 0, 0, accel])


def test_a_car_whose_way_nobody_counts_knows_neither_its_place_nor_its_speed() -> None:
    reckoning = DeadReckoning()
    for tick in range(11):
        reckoning.update(tick * STEP_M, 1.0, 0.3, 0.3)
    reckoning.lose()
    lost = reckoning.message(0)
    assert (lost.twist.twist.linear.x, lost.twist.twist.angular.z) == (0.0, 0.0)
    for covariance in (lost.pose.covariance, lost.twist.covariance):
        assert np.array_equal(square(list(covariance)), np.diag([NOT_MEASURED] * 6))
    reckoning.update(11 * STEP_M, 1.0, 0.3, 0.3)
    assert reckoning.message(0).twist.twist.linear.x == 1.0
    assert square(list(reckoning.message(0).pose.covariance))[0, 0] < 1.0
