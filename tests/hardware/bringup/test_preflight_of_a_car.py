"""The check before a drive: what is looked at, and what is said of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest
from test_sensor_steps import FakeSensors
from workbench import FILE, Workbench

from tral_env.errors import HardwareError
from tral_env.hardware.bringup.preflight import Finding, check_car
from tral_env.hardware.car_file import parse_car
from tral_env.hardware.sensor_drivers import Srf08Options
from tral_env.hardware.sensors import ImageTimes
from tral_env.interface import NO_ECHO_M

SONARS = '[[sensors]]\ndriver = "srf08"\n'
DONE = "[calibrated]\n" + "".join(
    f"{step} = 2026-05-01\n" for step in ("neutral", "ends", "direction", "dead_zone", "arming", "sonars")
)
ALL = dict.fromkeys(FakeSensors.provided_readings, 1.25)


def checked(bench: Workbench, text: str) -> dict[str, Finding]:
    found = check_car(parse_car(text), bench.start, bench.clock, bench.sleep)
    assert bench.rests
    return {each.what: each for each in found}


@pytest.fixture
def bench() -> Workbench:
    return Workbench()


def reads(monkeypatch: Any, bench: Workbench, readings: Mapping[str, float]) -> None:
    monkeypatch.setattr(Srf08Options, "open", lambda options, clock, sleep: FakeSensors(bench, lambda past_s: readings))


def test_a_car_that_is_whole_has_no_problem(bench: Workbench, monkeypatch: Any) -> None:
    reads(monkeypatch, bench, ALL | {"battery": 7.4})
    found = checked(bench, FILE + SONARS + DONE)
    assert {what: each.problem for what, each in found.items()} == dict.fromkeys(
        ("calibration", "board pca9685", "srf08", "battery"), ""
    )
    assert found["srf08"].told == "left 1.25 m, front 1.25 m, right 1.25 m"
    assert found["battery"].told == "7.40 V"
    assert found["board pca9685"].told == "without realtime, see docs/safety.md"


def test_steps_that_are_missing_are_named(bench: Workbench) -> None:
    found = checked(bench, FILE)
    assert found["calibration"].problem == (
        "missing: neutral, ends, direction, dead_zone, arming; run `tral car calibrate`"
    )
    assert found["sensors"].told == 'none: every reading is "nothing seen"'


def test_a_board_whose_clock_was_never_measured_stays_off(bench: Workbench) -> None:
    found = checked(bench, FILE.replace("true", "false") + SONARS + DONE)
    assert "its clock was never measured" in found["board pca9685"].problem
    assert bench.opened == []
    assert "srf08" not in found


def test_a_board_that_does_not_answer_is_told(bench: Workbench) -> None:
    def silent(settings: object) -> Any:
        raise HardwareError("no answer at 0x40")

    found = check_car(parse_car(FILE), silent, bench.clock, bench.sleep)
    assert found[-1] == Finding(what="board pca9685", problem="no answer at 0x40")


def test_a_reading_that_does_not_come_is_named(bench: Workbench, monkeypatch: Any) -> None:
    reads(monkeypatch, bench, {name: value for name, value in ALL.items() if name != "ultrasonic_left"})
    assert checked(bench, FILE + SONARS)["srf08"].problem == "no ultrasonic_left within 1 s"


@pytest.mark.parametrize(
    ("volts", "problem", "told"),
    [
        (6.2, "", "6.20 V is below warn_v = 6.6 V"),
        (5.9, "5.90 V is below stop_v = 6 V: charge it", ""),
        (0.0, "0.00 V: is it connected?", ""),
    ],
)
def test_a_low_battery_is_told(bench: Workbench, monkeypatch: Any, volts: float, problem: str, told: str) -> None:
    reads(monkeypatch, bench, ALL | {"battery": volts})
    assert checked(bench, FILE + SONARS)["battery"] == Finding(what="battery", problem=problem, told=told)


class Eye(FakeSensors):
    """A camera that gives an image in each second part of a second, or none at all."""

    provided_readings = frozenset({"gate_x", "gate_age"})
    period_s = 0.05

    @property
    def image_times(self) -> ImageTimes:
        exposed_s = self.bench.clock() // self.period_s * self.period_s
        return ImageTimes(exposed_s, exposed_s)


@pytest.mark.parametrize(("period_s", "problem"), [(0.05, ""), (1e6, "no image within 1 s")])
def test_a_camera_that_opens_and_gives_no_image_is_told(
    bench: Workbench, monkeypatch: Any, period_s: float, problem: str
) -> None:
    monkeypatch.setattr(Eye, "period_s", period_s)
    monkeypatch.setattr("tral_env.hardware.camera.Camera", lambda options, clock: Eye(bench, lambda past_s: {}))
    assert checked(bench, FILE + '[camera]\nlens = "wide"\n')["camera"].problem == problem


def test_what_a_standing_car_cannot_show_is_told(bench: Workbench, monkeypatch: Any) -> None:
    reads(monkeypatch, bench, ALL | {"ultrasonic_left": NO_ECHO_M, "distance": 0.0})
    told = checked(bench, FILE + SONARS)["srf08"].told
    assert told.startswith("left no echo: hold a hand before it, front 1.25 m, right 1.25 m, the wheel stands, so")


@pytest.mark.parametrize("when", ["open", "start", "read"])
def test_a_sensor_that_fails_is_told_and_the_others_are_still_looked_at(
    bench: Workbench, monkeypatch: Any, when: str
) -> None:
    def fail(*_: object) -> Any:
        raise HardwareError("no answer at 0x70")

    if when == "open":
        monkeypatch.setattr(Srf08Options, "open", fail)
    else:
        reads(monkeypatch, bench, ALL)
        monkeypatch.setattr(FakeSensors, when, fail)
    found = checked(bench, FILE + SONARS + '[camera]\nlens = "no_such_lens.yaml"\n')
    assert found["srf08"].problem == "no answer at 0x70"
    assert "cannot read the lens" in found["camera"].problem
