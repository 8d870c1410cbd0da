"""assets/car.xml against the figures of the specification."""

from __future__ import annotations

import itertools
import math

import mujoco
import numpy as np
import pytest
from bare_floor import CAR, WHEELS, DrivenCar, floor_model

from tral_env.assets import asset_path
from tral_env.config import CameraConfig, EscConfig, ServoConfig, UltrasonicConfig
from tral_env.interface import CONTROL_PERIOD_S

SONARS = {"left": (CAR.middle_x, CAR.sonar_side, 90.0), "front": (CAR.front_x, 0.0, 0.0)}
SONARS["right"] = (CAR.middle_x, -CAR.sonar_side, -90.0)
OBJECTS = ("body", "joint", "geom", "site", "camera", "actuator", "sensor", "tendon", "equality", "material", "mesh")


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return floor_model()


@pytest.fixture
def car(model: mujoco.MjModel) -> DrivenCar:
    return DrivenCar(model)


def rest(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


# --- what it is made of


def test_it_loads_alone() -> None:
    model = mujoco.MjModel.from_xml_path(str(asset_path("car.xml")))
    assert model.body("car").mass > 0


def test_every_object_has_a_name(model: mujoco.MjModel) -> None:
    counts = {"camera": "cam", "actuator": "u", "equality": "eq", "material": "mat", "joint": "jnt"}
    for kind in OBJECTS:
        number = getattr(model, f"n{counts.get(kind, kind)}")
        names = [getattr(model, kind)(i).name for i in range(number)]
        assert all(names), kind


def test_wheels_stand_where_the_configuration_says(model: mujoco.MjModel) -> None:
    data = rest(model)
    for wheel, x, y in zip(WHEELS, (CAR.wheelbase, CAR.wheelbase, 0, 0), (1, -1, 1, -1), strict=True):
        expected = [x, y * CAR.track / 2, CAR.wheel_radius]
        np.testing.assert_allclose(data.body(f"car/wheel_{wheel}").xpos, expected, atol=1e-12)
        assert model.geom(f"car/wheel_{wheel}").size[0] == CAR.wheel_radius


def test_mass_is_that_of_the_configuration(model: mujoco.MjModel) -> None:
    assert model.body("car/car").subtreemass[0] == pytest.approx(CAR.mass)


def test_centre_of_mass_lies_between_the_axles_and_low(model: mujoco.MjModel) -> None:
    x, y, z = rest(model).subtree_com[model.body("car/car").id]
    assert x == pytest.approx(CAR.wheelbase / 2, abs=0.002)
    assert y == pytest.approx(0.0, abs=1e-9)
    assert 0.05 <= z <= 0.06


def test_hull_has_the_outline_of_the_configuration(model: mujoco.MjModel) -> None:
    hull = model.geom("car/hull")
    np.testing.assert_allclose(2 * hull.size[:2], [CAR.length, CAR.width])
    np.testing.assert_allclose(hull.pos[:2], [CAR.middle_x, 0.0])


def test_motor_of_the_model_is_the_motor_of_the_configuration(model: mujoco.MjModel) -> None:
    esc = EscConfig()
    motor = model.actuator("car/drive")
    resistance, constant = motor.gainprm[:2]
    assert resistance == pytest.approx(esc.motor_resistance)
    assert constant == pytest.approx(esc.back_emf * CAR.wheel_radius)


def test_scrub_at_standstill_is_the_frictionloss_of_the_file() -> None:
    alone = mujoco.MjModel.from_xml_path(str(asset_path("car.xml")))
    assert alone.dof_frictionloss[alone.joint("steer").dofadr[0]] == ServoConfig().scrub_torque


# --- sensors and cameras


@pytest.mark.parametrize("side", SONARS)
def test_ultrasonic_is_a_flat_fan_over_its_beam(model: mujoco.MjModel, side: str) -> None:
    sonar = UltrasonicConfig()
    data = rest(model)
    x, y, boresight = SONARS[side]
    for ray in range(sonar.rays):
        site = data.site(f"car/ultrasonic_{side}_{ray:02d}")
        angle = math.radians(boresight - sonar.beam_deg / 2 + ray * sonar.beam_deg / (sonar.rays - 1))
        np.testing.assert_allclose(site.xpos, [x, y, CAR.sonar_height], atol=1e-12)
        np.testing.assert_allclose(site.xmat.reshape(3, 3)[:, 2], [math.cos(angle), math.sin(angle), 0], atol=1e-12)


def test_rays_see_nothing_of_the_car_itself(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    for angle in (-0.58, 0.0, 0.58):
        mujoco.mj_resetData(model, data)
        for joint in ("steer", "kingpin_left", "kingpin_right"):
            data.joint(f"car/{joint}").qpos = angle
        mujoco.mj_forward(model, data)
        for side, ray in itertools.product(SONARS, range(UltrasonicConfig().rays)):
            assert data.sensor(f"car/ultrasonic_{side}_{ray:02d}").data[0] == -1.0, (side, ray, angle)


def test_rays_are_cast_once_a_ranging(model: mujoco.MjModel) -> None:
    sensor = model.sensor("car/ultrasonic_front_05")
    assert model.sensor_interval[sensor.id, 0] == UltrasonicConfig().cadence_s
    assert model.sensor_cutoff[sensor.id] == 0  # a cutoff would read as a wall at that distance


def test_accelerometer_feels_gravity_at_rest(car: DrivenCar) -> None:
    car.drive(0.0, 0.0, 1.0)
    np.testing.assert_allclose(car.data.sensor("car/imu_accelerometer").data, [0, 0, 9.81], atol=0.02)
    np.testing.assert_allclose(car.data.sensor("car/imu_gyro").data, 0, atol=1e-3)


def test_front_camera_has_the_lens_and_the_place_of_the_configuration(model: mujoco.MjModel) -> None:
    lens = CameraConfig()
    camera = model.camera("car/front")
    assert camera.fovy[0] == pytest.approx(math.degrees(2 * math.atan(lens.height / 2 / lens.fy)), abs=1e-3)
    data = rest(model)
    np.testing.assert_allclose(data.camera("car/front").xpos, [CAR.camera_x, 0, CAR.camera_z], atol=1e-12)
    np.testing.assert_allclose(data.camera("car/front").xmat.reshape(3, 3)[:, 2], [-1, 0, 0], atol=1e-12)


def test_chase_camera_stays_within_a_corridor_and_above_its_walls(model: mujoco.MjModel) -> None:
    x, y, z = rest(model).camera("car/chase").xpos
    assert -0.8 < x < -CAR.length / 2
    assert y == 0.0
    assert z > 0.5


# --- standing


def test_car_at_rest_sits_on_the_floor(car: DrivenCar) -> None:
    car.drive(0.0, 0.0, 1.0)
    x, y, z = car.position
    assert abs(z) < 0.0005
    assert math.hypot(x, y) < 1e-6
    assert car.data.ncon == 4


# --- steering


@pytest.mark.parametrize("steering", [-1.0, -0.6, -0.3, 0.3, 0.6, 1.0])
def test_wheels_turn_about_one_centre(car: DrivenCar, steering: float) -> None:
    car.drive(steering, 0.5, 2.0)
    bicycle = math.tan(math.radians(car.angle_deg("steer")))
    for side, sign in (("left", -1), ("right", 1)):
        true = math.degrees(math.atan(CAR.wheelbase * bicycle / (CAR.wheelbase + sign * CAR.track / 2 * bicycle)))
        assert car.angle_deg(f"kingpin_{side}") == pytest.approx(true, abs=0.1), side


def test_ackermann_coefficients_hold_over_the_whole_travel(model: mujoco.MjModel) -> None:
    angle = np.radians(np.linspace(-33, 33, 133))
    for side, sign in (("left", -1), ("right", 1)):
        coefficients = model.equality(f"car/ackermann_{side}").data[:5]
        true = np.arctan(CAR.wheelbase * np.tan(angle) / (CAR.wheelbase + sign * CAR.track / 2 * np.tan(angle)))
        fitted = np.polynomial.polynomial.polyval(angle, coefficients)
        assert np.degrees(np.abs(fitted - true)).max() < 0.02


@pytest.mark.parametrize("steering", [-1.0, 1.0])
def test_turning_radius_at_full_lock_is_0_64_m(car: DrivenCar, steering: float) -> None:
    car.drive(steering, 0.5, 2.0)
    path = []
    for _ in range(200):
        car.drive(steering, 0.5, CONTROL_PERIOD_S)
        path.append(car.position[:2])
    x, y = np.array(path).T
    circle = np.linalg.lstsq(np.stack([2 * x, 2 * y, np.ones_like(x)], axis=1), x * x + y * y, rcond=None)[0]
    radius = math.sqrt(circle[2] + circle[0] ** 2 + circle[1] ** 2)
    assert radius == pytest.approx(0.64, rel=0.05)


def test_standing_the_servo_does_not_reach_its_angle(car: DrivenCar) -> None:
    car.drive(1.0, 0.0, 2.0)
    assert car.angle_deg("steer") < 0.8 * CAR.full_lock_deg


def test_rolling_at_1_metre_per_second_it_does(car: DrivenCar) -> None:
    car.drive(0.0, 0.5, 2.0)
    car.drive(1.0, 0.5, 2.0)
    assert car.wheel_speed == pytest.approx(1.0, abs=0.1)
    assert 0.97 * CAR.full_lock_deg < car.angle_deg("steer") < 1.01 * CAR.full_lock_deg


def test_the_angle_reached_grows_with_speed(model: mujoco.MjModel) -> None:
    reached = []
    for throttle in (0.0, 0.15, 0.2, 0.3, 0.5):
        car = DrivenCar(model)
        car.drive(0.0, throttle, 1.5)
        car.drive(1.0, throttle, 1.5)
        reached.append(car.angle_deg("steer"))
    assert reached == sorted(reached)


def test_a_servo_stuck_at_standstill_comes_round_when_the_car_rolls(car: DrivenCar) -> None:
    car.drive(1.0, 0.0, 1.0)
    stuck = car.angle_deg("steer")
    car.drive(1.0, 0.4, 1.5)
    assert car.angle_deg("steer") > stuck + 5.0


def test_a_stuck_servo_does_not_creep(car: DrivenCar) -> None:
    car.drive(1.0, 0.0, 1.0)
    stuck = car.angle_deg("steer")
    car.drive(1.0, 0.0, 5.0)
    assert car.angle_deg("steer") == pytest.approx(stuck, abs=0.1)


def test_steering_rate_is_that_of_the_servo(car: DrivenCar) -> None:
    car.drive(1.0, 0.5, 2.0)
    car.drive(-1.0, 0.5, 0.4)
    rate = -np.diff(car.steering_deg).min() / CONTROL_PERIOD_S
    assert rate == pytest.approx(math.degrees(ServoConfig().speed), rel=0.05)


def test_an_offset_bends_the_path_as_the_bicycle_model_says(car: DrivenCar) -> None:
    offset = math.radians(6.0)
    car.actuation.parameters.steering_offset[0] = offset
    car.actuation.reset(slice(None))
    car.drive(0.0, 0.5, 3.0)
    curvature = car.yaw_rate / math.hypot(*car.data.joint("car/root").qvel[:2])
    assert curvature == pytest.approx(math.tan(offset) / CAR.wheelbase, rel=0.08)


def test_without_offset_it_drives_straight(car: DrivenCar) -> None:
    while car.position[0] < 5.0:
        car.drive(0.0, 0.5, 0.1)
    assert abs(car.position[1]) < 0.01


# --- driving


@pytest.mark.parametrize(("level", "speed"), [(200, 0.26), (300, 0.60), (400, 0.83), (500, 1.0), (700, 1.58)])
def test_speed_against_throttle_level(car: DrivenCar, level: int, speed: float) -> None:
    car.drive(0.0, level / 1000, 3.0)
    assert car.wheel_speed == pytest.approx(speed, abs=max(0.08, 0.1 * speed))


def test_top_speed_continues_the_measured_line(car: DrivenCar) -> None:
    levels, speeds = np.array([0.2, 0.3, 0.4, 0.5, 0.7]), np.array([0.26, 0.60, 0.83, 1.0, 1.58])
    car.drive(0.0, 1.0, 4.0)
    assert car.wheel_speed == pytest.approx(np.polyval(np.polyfit(levels, speeds, 1), 1.0), rel=0.05)


def test_it_gains_speed_within_a_third_of_a_second(car: DrivenCar) -> None:
    car.drive(0.0, 0.5, 3.0)
    reached = np.argmax(np.array(car.speeds) > 0.632 * car.wheel_speed) * CONTROL_PERIOD_S
    assert reached == pytest.approx(0.3, abs=0.05)


def test_within_the_dead_zone_it_stands(car: DrivenCar) -> None:
    car.drive(0.0, 0.07, 1.0)
    assert car.position[0] == pytest.approx(0.0, abs=1e-6)


def test_full_brake_stops_as_a_shorted_motor_does(car: DrivenCar) -> None:
    car.drive(0.0, 0.5, 3.0)
    speed, start = car.wheel_speed, car.position[0]
    latency = car.actuation.parameters.latency_s[0] * speed
    car.drive(0.0, -1.0, 2.0)
    assert car.wheel_speed == pytest.approx(0.0, abs=1e-6)
    assert car.position[0] - start == pytest.approx(latency + shorted_stop(speed), rel=0.05)


def shorted_stop(speed: float) -> float:
    """Way that a shorted motor, drag and mass leave: m' dv/dt = -(F0 + c v); integral of v until v = 0."""
    esc, radius = EscConfig(), CAR.wheel_radius
    inertia = 4 * (3.3e-5 + 9e-5) / radius**2
    mass, constant = CAR.mass + inertia, 0.016 / radius
    viscous = esc.back_emf**2 / esc.motor_resistance + 1.33e-3 / radius**2
    ratio = constant / viscous
    return mass / viscous * (speed - ratio * math.log(1 + speed / ratio))


def test_neutral_lets_it_roll_several_times_as_far_as_the_brake(model: mujoco.MjModel) -> None:
    ways = []
    for throttle in (0.0, -1.0):
        car = DrivenCar(model)
        car.drive(0.0, 0.5, 3.0)
        start = car.position[0]
        car.drive(0.0, throttle, 5.0)
        ways.append(car.position[0] - start)
    assert 3.0 < ways[0] / ways[1] < 5.0


def test_wheels_on_the_outside_of_a_bend_turn_faster(car: DrivenCar) -> None:
    car.drive(1.0, 0.4, 3.0)
    left, right = (car.data.joint(f"car/wheel_rear_{side}").qvel[0] for side in ("left", "right"))
    radius = CAR.wheelbase / math.tan(math.radians(car.angle_deg("steer")))
    assert right / left == pytest.approx((radius + CAR.track / 2) / (radius - CAR.track / 2), rel=0.03)


def test_it_drives_backwards_after_brake_and_neutral(car: DrivenCar) -> None:
    car.drive(0.0, 0.4, 1.0)
    car.drive(0.0, -1.0, 1.0)
    assert car.wheel_speed == pytest.approx(0.0, abs=1e-6)
    car.drive(0.0, 0.0, 0.2)
    car.drive(0.0, -0.4, 2.0)
    assert car.wheel_speed == pytest.approx(-0.83, abs=0.08)
