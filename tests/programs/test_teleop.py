"""A person drives a car without devices, and a simulated one; both leave a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_car import CAR, car_file
from on_the_car import Person, Rolling, Words, cockpit

from tral_env.errors import ConfigError, HardwareError
from tral_env.hardware.bringup.preflight import Finding, check_car
from tral_env.hardware.car_file import CarFile
from tral_env.recording.read import read
from tral_fsm.evaluation.recording import episode_of
from tral_fsm.programs.seat import Course
from tral_fsm.programs.teleop import TeleopArguments, run
from tral_fsm.teleop.hands import Hands

STRAIGHT = Course(scenario="straight", seed=3, randomization="none")


def drives(now: float) -> Hands:
    """Half a second at rest, then forward, and a little to the left."""
    return Hands(0.3, 0.0 if now < 0.5 else 0.8, holds=True, end=now > 2.0)


def by_hand(folder: Path, person: Person, check: Any = check_car, **arguments: Any) -> dict[str, Any]:
    sensors = Rolling() if "config" in arguments else None
    return run(TeleopArguments(**arguments), cockpit(folder, person, sensors=sensors, check=check))


def test_a_person_drives_the_car_and_the_drive_is_data(tmp_path: Path) -> None:
    report = by_hand(tmp_path, Person(drives), config=car_file(tmp_path), dry=True)
    assert (report["ended_by"], report["failed"]) == ("ended by the keyboard", False)
    found = read(tmp_path / "out" / "drive.mcap")
    assert found.action[0].tolist() == pytest.approx([0.1387, 0.0], abs=1e-3)
    assert found.action[-1].tolist() == pytest.approx([0.1387, 0.35 * 0.7 / 0.9], abs=1e-3)
    assert set(found.states) == {"by hand"}


def test_a_person_drives_a_simulated_car_in_real_time(tmp_path: Path) -> None:
    report = by_hand(tmp_path, Person(drives), course=STRAIGHT)
    figures = report["figures"]
    assert figures["time_s"] == pytest.approx(2.0, abs=0.03)
    assert figures["distance_m"] > 0.3
    episode = episode_of(read(tmp_path / "out" / "drive.mcap"))
    assert (episode.seed, episode.scenario) == (3, "straight")
    assert len(episode.trace.action) == figures["ticks"]


def test_what_a_person_does_is_what_the_simulated_car_is_told(tmp_path: Path) -> None:
    by_hand(tmp_path, Person(lambda now: drives(now)._replace(holds=now < 1.0)), course=STRAIGHT)
    found = read(tmp_path / "out" / "drive.mcap")
    driven = np.flatnonzero(found.action[:, 1])
    assert driven[0] == pytest.approx(40, abs=2)
    assert driven[-1] == pytest.approx(80, abs=2)
    assert found.states[-1] == "let go"


def test_a_simulated_drive_that_ends_says_how(tmp_path: Path) -> None:
    wall = Person(lambda now: Hands(1.0, 0.0 if now < 0.1 else 1.0, holds=True))
    report = by_hand(tmp_path, wall, course=STRAIGHT, record=False)
    assert report["ended_by"] == "a touch"
    assert report["recording"] == ""


def test_a_simulated_drive_ends_by_its_time(tmp_path: Path) -> None:
    report = by_hand(tmp_path, Person(lambda now: Hands()), course=STRAIGHT, max_duration_s=1.0)
    assert (report["ended_by"], report["failed"]) == ("time limit", False)
    assert report["figures"]["ticks"] == 80


def test_a_real_car_drives_after_the_preflight_of_a_deploy(tmp_path: Path) -> None:
    words, config = Words(), car_file(tmp_path)
    asked: list[str] = []

    def check(car: CarFile) -> list[Finding]:
        asked.append(car.name)
        return [Finding(what="srf08", told="left 0.80 m"), Finding(what="calibration", problem="missing: neutral")]

    arguments = TeleopArguments(config=config)
    with pytest.raises(HardwareError, match=r"the pre-flight refuses this car:\n  calibration: missing: neutral"):
        run(arguments, cockpit(tmp_path, Person(drives), sensors=Rolling(), console=words, check=check))
    assert asked == ["bench"]
    assert words.said == ["pre-flight, srf08: left 0.80 m", "pre-flight, calibration: missing: neutral"]
    assert not (tmp_path / "out").exists()


def test_a_car_file_without_a_calibrated_step_is_refused_by_itself(tmp_path: Path) -> None:
    log = CAR.replace('driver = "pca9685"\nclock_measured = true', f'driver = "log"\nbus = "{tmp_path}/log"')
    (tmp_path / "car.toml").write_text(log)
    arguments = TeleopArguments(config=str(tmp_path / "car.toml"))
    with pytest.raises(HardwareError, match=r"calibration: missing: .*neutral"):
        run(arguments, cockpit(tmp_path, Person(drives)))


@pytest.mark.parametrize("arguments", [{"dry": True, "config": "car.toml"}, {"course": STRAIGHT}])
def test_a_dry_run_and_a_simulated_car_have_no_preflight(tmp_path: Path, arguments: dict[str, Any]) -> None:
    def never(car: CarFile) -> list[Finding]:
        raise AssertionError("nothing moves")

    if "config" in arguments:
        arguments = arguments | {"config": car_file(tmp_path)}
    person = Person(lambda now: Hands(end=now > 0.1))
    by_hand(tmp_path, person, never, **arguments)
    assert (tmp_path / "out" / "summary.json").exists()


def test_a_dry_run_of_a_simulated_car_is_refused() -> None:
    with pytest.raises(ConfigError, match="--dry beside --scenario"):
        TeleopArguments(course=STRAIGHT, dry=True)


@pytest.mark.parametrize("seconds", [0.0, -1.0, np.nan])
def test_a_time_is_above_0(seconds: float) -> None:
    with pytest.raises(ConfigError, match="max_duration_s"):
        TeleopArguments(course=STRAIGHT, max_duration_s=seconds)


@pytest.mark.parametrize("which", [{}, {"config": "car.toml", "course": STRAIGHT}])
def test_it_is_one_car(which: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="either a car file"):
        TeleopArguments(**which)


def test_nobody_drives_without_a_device(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no terminal and no gamepad.* or with --gamepad\.$"):
        run(TeleopArguments(course=STRAIGHT), cockpit(tmp_path))
