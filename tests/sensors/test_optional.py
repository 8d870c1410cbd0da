"""The optional groups: only those that were asked for, each from its own source."""

import numpy as np
import pytest

from tral_env.config import ImuConfig
from tral_env.interface import OPTIONAL_GROUPS, Layout
from tral_env.noise import NoiseTape
from tral_env.sensors.imu import STANDARD_GRAVITY, UNITS, noise_sigma
from tral_env.sensors.optional import OptionalReadings

BOTH, NO_TAPE = np.arange(2), np.zeros((0, 4))
POSE = np.zeros((2, 3))
AT_REST = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, STANDARD_GRAVITY], (2, 1))
VOLTS = np.array([7.0, 8.0])


def noise() -> NoiseTape:
    tape = NoiseTape(2)
    for row in BOTH:
        tape.reset(int(row), np.random.default_rng(int(row)))
    return tape


def optional(*groups: str) -> OptionalReadings:
    """Two cars on a bare floor."""
    readings = OptionalReadings(2, Layout.of(groups), noise())
    for row in BOTH:
        readings.place(int(row), NO_TAPE)
    return readings


@pytest.mark.parametrize("groups", [(), ("line",), ("imu",), ("battery",), ("imu", "line")])
def test_there_are_the_groups_that_were_asked_for_and_no_others(groups: tuple[str, ...]) -> None:
    cars = optional(*groups)
    cars.update(BOTH, POSE, AT_REST, VOLTS)
    assert set(cars.readings()) == {field.name for group in groups for field in OPTIONAL_GROUPS[group]}


def test_the_battery_is_the_voltage_under_load_of_the_cars_that_moved() -> None:
    cars = optional("battery")
    cars.update(BOTH, POSE, AT_REST, VOLTS)
    cars.update(np.array([1]), POSE, AT_REST, np.array([6.5]))
    assert cars.readings()["battery"].tolist() == [7.0, 6.5]


def test_the_line_is_the_tape_below_the_car_that_has_some() -> None:
    cars = optional("line")
    cars.place(1, np.array([[-1.0, 0.0, 1.0, 0.0]]))
    cars.update(BOTH, POSE, AT_REST, VOLTS)
    assert cars.readings()["line"].tolist() == [0, 0b00011000]


def test_a_new_course_takes_the_old_tape_away() -> None:
    cars = optional("line")
    cars.place(0, np.array([[-1.0, 0.0, 1.0, 0.0]]))
    cars.place(0, NO_TAPE)
    cars.update(BOTH, POSE, AT_REST, VOLTS)
    assert cars.readings()["line"].tolist() == [0, 0]


def test_the_imu_has_the_bias_of_its_drive_and_noise_of_its_own() -> None:
    cars, names = optional("imu"), [field.name for field in OPTIONAL_GROUPS["imu"]]
    read = np.zeros((500, 2, len(names)))
    for values in read:
        cars.update(BOTH, POSE, AT_REST, VOLTS)
        values[:] = np.stack([cars.readings()[name] for name in names], axis=1)
    assert read.std(axis=0) == pytest.approx(np.tile(noise_sigma(ImuConfig()), (2, 1)), rel=0.15)
    bias = read.mean(axis=0) - AT_REST
    assert np.all(np.abs(bias) > 0)
    assert not np.any(np.isclose(bias[0], bias[1]))


def test_the_imu_has_the_units_of_its_fields() -> None:
    assert tuple(field.unit for field in OPTIONAL_GROUPS["imu"]) == UNITS
