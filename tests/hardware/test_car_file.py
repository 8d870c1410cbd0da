"""The car file: what it says, and how every mistake in it is told with its line."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path

import pytest

from tral_env.errors import BadFileError, UnreadableCarError
from tral_env.hardware.actuator.settings import Limits, Settings
from tral_env.hardware.calibration_file import load_calibration
from tral_env.hardware.car_file import BatteryLimits, CameraOptions, CarFile, load_car, parse_car
from tral_env.hardware.faults import FaultLimits

LEAST = """\
version = 1
name = "mine"

[board]
driver = "pca9685"

[pulses]
file = "tt01"
"""


def refusal(text: str) -> list[str]:
    """What is told about a file, a line for each problem."""
    with pytest.raises(BadFileError) as refused:
        parse_car(text)
    return [line.strip() for line in str(refused.value).splitlines()]


def problem(more: str) -> str:
    """The only problem of the least file with something behind it."""
    head, told = refusal(LEAST + more)
    assert head == "car.toml: 1 problem"
    return told


def test_the_least_file_has_the_packaged_pulses_and_all_defaults() -> None:
    car = parse_car(LEAST)
    assert car.calibration == load_calibration("tt01").model_copy(update={"name": "mine", "schema_": None})
    assert (car.sensors, car.camera, car.limits, car.battery) == ((), None, Limits(), BatteryLimits())
    assert (car.board.options.bus, car.board.options.address) == (1, 0x40)
    assert not car.clock_is_known


def test_the_actuator_is_told_what_the_file_says() -> None:
    settings = parse_car(
        LEAST.replace('"pca9685"', '"pca9685"\nbus = 3\naddress = 0x41\noscillator_hz = 26e6')
    ).settings
    assert (settings.driver, settings.bus, settings.address, settings.oscillator_hz) == ("pca9685", 3, 0x41, 26e6)
    assert settings.options == {"bus": 3, "address": 0x41}
    assert Settings.from_json(settings.to_json()) == settings


def test_values_beside_a_file_of_pulses_count_before_those_of_the_file() -> None:
    car = parse_car(LEAST + "[pulses.steering]\ntrim_us = -12\nleft_us = 1300\n")
    assert (car.calibration.steering.trim_us, car.calibration.steering.left_us) == (-12, 1300)
    assert car.calibration.steering.right_us == 1810


def test_pulses_may_stand_in_the_file_itself() -> None:
    told = load_calibration("tt01")
    tables = "".join(
        f"[pulses.{part}]\n"
        + "".join(f"{name} = {json.dumps(value)}\n" for name, value in values.items() if value is not None)
        for part, values in (("steering", told.steering.model_dump()), ("throttle", told.throttle.model_dump()))
    )
    inline = LEAST.replace('[pulses]\nfile = "tt01"\n', tables).replace('"pca9685"', '"pca9685"\nperiod_us = 17430')
    assert parse_car(inline) == parse_car(LEAST)


def test_a_calibration_file_of_yesterday_is_read_from_beside_the_car_file(tmp_path: Path) -> None:
    content = load_calibration("tt01").model_dump(exclude={"schema_"}) | {"clock_measured": True, "oscillator_hz": 26e6}
    (tmp_path / "old.json").write_text(json.dumps(content))
    (tmp_path / "car.toml").write_text(LEAST.replace("tt01", "old.json"))
    car = load_car(tmp_path / "car.toml")
    assert car.clock_is_known
    assert car.calibration.oscillator_hz == 26e6
    assert load_car(car) is car


def test_the_board_says_the_clock_before_the_calibration_file_does() -> None:
    assert parse_car(LEAST.replace('"pca9685"', '"pca9685"\nclock_measured = true')).clock_is_known


def test_all_tables_are_read(tmp_path: Path) -> None:
    car = parse_car(
        LEAST
        + """
[[sensors]]
driver = "srf08"
bus = "/dev/i2c-5"
addresses = {left = 0x74, right = 0x75}
[camera]
device = "/dev/video2"
lens = "lens.yaml"
[limits]
max_throttle = 0.4
evidence_s = 2
[battery]
warn_v = 7
stop_v = 6.5
[calibrated]
neutral = 2026-05-01
""",
        folder=tmp_path,
    )
    (sensor,) = car.sensors
    assert (sensor.driver, sensor.options.bus) == ("srf08", "/dev/i2c-5")
    assert sensor.options.addresses == {"left": 0x74, "right": 0x75}
    assert car.camera == CameraOptions(device="/dev/video2", lens=str(tmp_path / "lens.yaml"))
    assert car.limits == Limits(max_throttle=0.4, evidence_s=2.0)
    assert car.battery == BatteryLimits(warn_v=7.0, stop_v=6.5)
    assert car.calibrated == {"neutral": date(2026, 5, 1)}


def test_the_word_none_means_no_sensors() -> None:
    assert parse_car('sensors = "none"\n' + LEAST).sensors == ()


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ("[limits]\nhang_s = 80\n", "car.toml:10: limits.hang_s: got 80 s: expected 0.03 to 0.5 s; is it in ms?"),
        ("[camera]\nmarker_size = 180\n", "marker_size: got 180 m: expected 0.005 to 2 m; is it in mm or cm?"),
        ("[camera]\nwidth = '640'\n", "car.toml:10: camera.width: got '640', expected a whole number"),
        ("[camera]\nrate = 30\n", "car.toml:10: camera.rate: unknown; did you mean 'rate_hz'? Allowed: device, "),
        ("[[sensors]]\nbus = 1\n", "car.toml:9: sensors[1]: 'driver' is missing"),
        (
            "[[sensors]]\ndriver = 'srf8'\n",
            "car.toml:10: sensors[1].driver: unknown sensors 'srf8': did you mean 'srf08'",
        ),
        (
            "[[sensors]]\ndriver = 'srf08'\n[[sensors]]\ndriver = 'srf08'\nfiring = 'in tur'\n",
            "car.toml:13: sensors[2].firing: got 'in tur', expected one of 'together', 'in turn'",
        ),
        ("[[sensors]]\ndriver = 'srf08'\naddresses = {left = 0xE0}\n", "the data sheets' 0xE0 is 0x70 here"),
        ("[[sensors]]\ndriver = 'srf08'\naddresses = {port = 1}\n", "unknown side 'port'"),
        ("[[sensors]]\ndriver = 'srf08'\naddresses = {}\n", "expected some of left, front, right"),
        ("[[sensors]]\ndriver = 'srf08'\naddresses = {left = 112, right = 112}\n", "two sides have one address"),
        ("[battery]\nstop_v = 7\n", "car.toml:9: battery: stop_v = 7 V is not below warn_v = 6.6 V"),
        ("[battery]\nwarn_v = 6600\n", "warn_v: got 6600 V: expected 1 to 60 V; is it in mV?"),
        ("[limits]\noff_s = 0.05\n", "limits: off_s = 0.05 is not above silence_s = 0.1"),
        ("[calibrated]\nneutral = true\n", "calibrated.neutral: got True, expected a day such as 2026-05-01"),
        ("[calibrated]\nhal = 2026-05-01\n", "calibrated.hal: unknown; did you mean 'hall'?"),
        ("[pulses.steering]\ntrim_us = 5000\n", "car.toml:10: pulses.steering.trim_us: got 5000"),
        ("[pulses.steering]\nlefft_us = 1\n", "pulses.steering.lefft_us: unknown; did you mean 'left_us'?"),
        ("[pulses.throttle]\nmax_us = 1800\n", "car.toml:9: pulses.throttle: command -1 is 1860 us, outside the"),
        ("[sonars]\n", "car.toml:9: sonars: unknown; did you mean 'sensors'?"),
    ],
)
def test_a_mistake_is_told_with_its_line(more: str, told: str) -> None:
    assert told in problem(more)


def test_all_mistakes_are_told_at_once() -> None:
    text = 'version = 2\n[board]\ndriver = "pca9658"\n[pulses]\nfile = "tt1"\n'
    assert [line.partition(": ")[0] for line in refusal(text)] == ["car.toml", "car.toml", "car.toml:3", "car.toml:5"]
    assert "did you mean 'pca9685'" in refusal(text)[2]
    assert "did you mean 'tt01'" in refusal(text)[3]


def test_an_empty_file_lacks_the_least() -> None:
    assert refusal("")[1:] == [f"car.toml: '{name}' is missing" for name in ("version", "name", "board", "pulses")]


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("a = 0,5", "a decimal comma? TOML writes 0.8"),
        ("a = .5", "TOML writes 0.8, not .8"),
        ("a = True", 'TOML writes true, false, or "text" in quotes'),
        ("a = /dev/i2c-1", 'a text stands in "quotes"'),
        ("a = 1\na = 2", "Cannot overwrite a value"),
    ],
)
def test_what_is_no_toml_is_told_with_what_may_be_the_reason(line: str, told: str) -> None:
    (line_told,) = refusal(line)
    assert line_told.startswith("car.toml: not TOML: ")
    assert told in line_told


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(UnreadableCarError, match=r"cannot read .*No such file .*`tral car init` writes a car"):
        load_car(tmp_path / "car.toml")


def test_a_car_compares_by_what_it_says() -> None:
    assert isinstance(parse_car(LEAST), CarFile)
    assert parse_car(LEAST) == parse_car("# a comment\n" + LEAST)


def test_a_car_without_sensors_may_switch_the_law_of_frozen_ones_off() -> None:
    assert parse_car(LEAST + '[limits]\nevidence_s = "off"\n').limits == Limits(evidence_s=None)


def test_the_limits_of_faults_are_read_and_off_switches_a_law_off() -> None:
    car = parse_car(
        LEAST + '[faults]\nsilent_s = 1\nfrozen_m = "off"\nechoes = 3\n[battery]\nwarn_v = 11\nstop_v = 10\n'
    )
    assert car.faults == FaultLimits(silent_s=1.0, frozen_m=None, echoes=3)
    assert car.fault_limits() == FaultLimits(
        silent_s=1.0, frozen_m=None, echoes=3, battery_low_v=11.0, battery_empty_v=10.0
    )


def test_faults_that_are_given_keep_the_battery_of_the_car_unless_they_name_another() -> None:
    car = parse_car(LEAST + "[battery]\nwarn_v = 11\nstop_v = 10\n")
    assert car.fault_limits(FaultLimits(blind_m=0.4)) == FaultLimits(
        blind_m=0.4, battery_low_v=11.0, battery_empty_v=10.0
    )
    assert car.fault_limits(FaultLimits(battery_low_v=None, battery_empty_v=9.0)) == FaultLimits(
        battery_low_v=None, battery_empty_v=9.0
    )


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ("[faults]\nsilent_s = -1\n", "faults: faults: silent_s = -1.0, expected a number above 0"),
        ('[faults]\nmoving_mps = "off"\n', "faults.moving_mps: got 'off', expected a number"),
        ("[faults]\nbattery_low_v = 7\n", "faults.battery_low_v: stands in [battery], as warn_v"),
        ("[faults]\nsilence = 7\n", "faults.silence: unknown; did you mean 'silent_s'?"),
    ],
)
def test_what_a_table_of_faults_may_not_say(more: str, told: str) -> None:
    assert told in problem(more)


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ("[camera]\nrate_hz = 1\n", "camera: with rate_hz = 1 and latency_s = 0 the newest image gets 1.00 s old"),
        ("[camera]\nlatency_s = 0.9\n", "image_s = 0.5 s would stop every drive"),
        ('[[sensors]]\ndriver = "srf08"\ncadence_s = 0.5\nfiring = "in turn"\n', "sensors[1]: a range gets 1.56 s old"),
        ('[[sensors]]\ndriver = "srf08"\n[limits]\nevidence_s = "off"\n', 'evidence_s: "off" is for a car without'),
    ],
)
def test_options_that_would_stop_every_drive_or_none_are_refused_together(more: str, told: str) -> None:
    assert told in problem(more)


@pytest.mark.parametrize(
    "more",
    [
        "[camera]\nrate_hz = 1\n[faults]\nimage_s = 1.5\n",
        '[camera]\nrate_hz = 1\n[faults]\nimage_s = "off"\n',
        '[[sensors]]\ndriver = "srf08"\nfiring = "in turn"\n',
        '[[sensors]]\ndriver = "srf08"\ncadence_s = 0.5\n[faults]\nsilent_s = 1\n',
    ],
)
def test_slow_devices_are_allowed_with_limits_that_fit_them(more: str) -> None:
    assert parse_car(LEAST + more).name == "mine"
