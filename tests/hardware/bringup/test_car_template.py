"""The car file to begin with: it is read as it stands, and tells every option there is."""

from __future__ import annotations

import re
from dataclasses import fields

import pytest

from tral_env.errors import ConfigError
from tral_env.hardware.actuator.drivers import BOARDS
from tral_env.hardware.actuator.settings import Limits
from tral_env.hardware.bringup.template import BOARD_SENSORS, car_text
from tral_env.hardware.camera_options import CameraOptions
from tral_env.hardware.car_file import BatteryLimits, parse_car
from tral_env.hardware.faults import FaultLimits
from tral_env.hardware.sensor_drivers import SENSORS


@pytest.mark.parametrize("board", BOARDS)
def test_each_board_has_a_file_that_is_read_as_it_stands(board: str) -> None:
    car = parse_car(car_text("mine", board=board))
    assert (car.name, car.board.driver) == ("mine", board)
    assert tuple(sensor.driver for sensor in car.sensors) == BOARD_SENSORS[board]
    assert car.camera == CameraOptions()
    assert car.limits == Limits(max_throttle=0.4)
    assert not car.calibrated


def everything(text: str) -> str:
    """The text with all its lines in force that stand behind a #."""
    return re.sub(r"^# (\[|\w+ = )", r"\1", text, flags=re.MULTILINE)


@pytest.mark.parametrize("board", BOARDS)
@pytest.mark.parametrize("sensor", SENSORS)
def test_the_lines_behind_a_mark_have_the_defaults(board: str, sensor: str) -> None:
    plain = car_text(board=board, sensors=[sensor])
    whole = everything(plain).replace("slew_per_s = 8.0", "").replace('lens = "camera_info.yaml"', "")
    assert parse_car(whole) == parse_car(plain)


def test_every_option_stands_in_it() -> None:
    text = "".join(everything(car_text(board=board)) for board in BOARDS) + everything(car_text(sensors=SENSORS))
    named = set(re.findall(r"^(\w+) =", text, re.MULTILINE))
    for kind in (*BOARDS.values(), *SENSORS.values(), CameraOptions, Limits, BatteryLimits):
        assert {each.name for each in fields(kind)} <= named, kind  # type: ignore[arg-type]
    in_battery = {"battery_empty_v", "battery_low_v"}
    assert {each.name for each in fields(FaultLimits)} - in_battery <= named


def test_a_name_may_have_quotes_in_it() -> None:
    assert parse_car(car_text('the "red" one\\')).name == 'the "red" one\\'


@pytest.mark.parametrize("name", ["", "  ", "x\ny", "tab\t", "\x7f", "\udcff"])
def test_a_name_that_is_no_line_of_text_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match=r"name = .*: expected a line of text that can be read"):
        car_text(name)


@pytest.mark.parametrize(
    ("sensors", "told"), [(("hall", "hall"), "one is named twice"), (("none", "hall"), "'none' stands alone")]
)
def test_sensors_that_cannot_be_together_are_refused(sensors: tuple[str, ...], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        car_text(sensors=sensors)


def test_none_is_a_car_without_sensors() -> None:
    assert car_text(sensors=["none"]) == car_text(sensors=())


def test_a_car_may_have_neither_sensors_nor_a_camera() -> None:
    car = parse_car(car_text(sensors=(), camera=False))
    assert (car.sensors, car.camera) == ((), None)


@pytest.mark.parametrize(
    ("options", "told"),
    [({"board": "pca9658"}, "did you mean 'pca9685'"), ({"sensors": ["srf09"]}, "unknown sensor 'srf09'")],
)
def test_a_name_that_there_is_not_is_refused(options: dict[str, str], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        car_text(**options)  # type: ignore[arg-type]
