"""A policy drives a car without devices: who arms, what stops it, what is left of the drive."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_car import car_file
from on_the_car import Person, Rolling, Words, cockpit

from tral_env.errors import ConfigError, HardwareError, PolicyError, SourceLostError
from tral_env.hardware.bringup.preflight import Finding
from tral_env.hardware.car_file import CarFile
from tral_env.hardware.faults import FaultLimits
from tral_env.recording.read import read
from tral_fsm.programs.deploy import DeployArguments, run
from tral_fsm.programs.drive import SUMMARY
from tral_fsm.teleop.hands import Hands

POLICY = """
import os, signal
import numpy as np

class Straight:
    needed_readings = {"speed"}
    active_states = ["straight"]

    def act(self, observation):
        return np.array([0.1, 0.3], np.float32)

class Failing:
    def act(self, observation):
        raise RuntimeError("no idea")

class Hungry:
    needed_readings = {"gate_id"}

    def act(self, observation):
        return np.zeros(2)
"""


def deploy(folder: Path, person: Person | None = None, name: str = "Straight", **changes: Any) -> dict[str, Any]:
    (folder / "own.py").write_text(POLICY)
    around = {key: changes.pop(key) for key in ("must_hold", "check", "console") if key in changes}
    sensors, options = changes.pop("sensors", Rolling()), {"faults": changes.pop("faults", None)}
    arguments = DeployArguments(
        policy=f"{folder}/own.py:{name}", config=car_file(folder), **({"max_duration_s": 2.0, "dry": True} | changes)
    )
    devices = [person] if person is not None else []
    return run(arguments, cockpit(folder, *devices, sensors=sensors, options=options, **around))


def test_a_drive_ends_by_its_time_and_leaves_a_summary_and_a_recording(tmp_path: Path) -> None:
    words = Words()
    report = deploy(tmp_path, Person(), console=words)
    assert report == json.loads((tmp_path / "out" / SUMMARY).read_text())
    assert (report["ended_by"], report["failed"], report["warnings"]) == ("time limit", False, [])
    assert report["figures"]["ticks"] == 160
    assert report["figures"]["time_s"] == 2.0
    assert report["figures"]["late_ticks"] == 0
    assert report["figures"]["states_s"] == {"straight": pytest.approx(2.0)}
    assert words.said == [
        "To arm, press r on the keyboard; q or back ends. Any other key stops the car.",
    ]
    assert words.shown[-1].startswith("   1.8 s    80 Hz  late 0.0%  L 1.0")
    assert words.shown[-1].endswith(" m  0.50 m/s  7.6 V  straight")
    found = read(tmp_path / "out" / report["recording"])
    assert found.action.tolist() == [pytest.approx([0.1, 0.3])] * 160
    assert found.states[-1] == "straight"
    assert "own.py" in found.files


def test_without_a_recording_there_is_none(tmp_path: Path) -> None:
    assert deploy(tmp_path, Person(), record=False)["recording"] == ""
    assert not list((tmp_path / "out").glob("*.mcap"))


def test_a_second_drive_removes_the_files_of_the_first(tmp_path: Path) -> None:
    deploy(tmp_path, Person())
    deploy(tmp_path, Person())
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["drive.mcap", "summary.json"]


def test_without_anyone_to_stop_it_the_car_does_not_drive(tmp_path: Path) -> None:
    def never(car: CarFile) -> list[Finding]:
        raise AssertionError("nobody is there")

    with pytest.raises(ConfigError, match=r"no terminal and no gamepad.* --arm drives at once"):
        deploy(tmp_path, dry=False, check=never)
    assert not (tmp_path / "out").exists()


def test_without_anyone_to_stop_it_an_option_arms(tmp_path: Path) -> None:
    report = deploy(tmp_path, arm=True)
    assert (report["ended_by"], report["figures"]["ticks"]) == ("time limit", 160)


def test_a_dry_run_moves_no_motor_so_it_needs_nobody(tmp_path: Path) -> None:
    words = Words()
    report = deploy(tmp_path, console=words)
    assert (report["ended_by"], report["figures"]["ticks"]) == ("time limit", 160)
    assert words.said == []


def test_a_dry_run_with_a_person_is_armed_by_that_person(tmp_path: Path) -> None:
    words = Words()
    deploy(tmp_path, Person(), console=words)
    assert words.said[0].startswith("To arm, press r")


@pytest.mark.parametrize(
    ("then", "why", "failed"),
    [
        (Hands(stop=True), "emergency stop by the keyboard", True),
        (Hands(end=True), "ended by the keyboard", False),
        (SourceLostError("the terminal is gone"), "the terminal is gone", True),
    ],
)
def test_a_person_ends_the_drive(tmp_path: Path, then: Hands | Exception, why: str, failed: bool) -> None:
    report = deploy(tmp_path, Person(lambda now: then if now > 1.0 else Hands()))
    assert (report["ended_by"], report["failed"]) == (why, failed)
    assert report["figures"]["time_s"] == pytest.approx(1.0, abs=0.03)


def test_a_person_who_ends_before_arming_drives_nothing(tmp_path: Path) -> None:
    class Leaves(Person):
        def poll(self, now_s: float) -> Hands:
            return Hands(end=True)

    report = deploy(tmp_path, Leaves())
    assert (report["ended_by"], report["figures"]["ticks"], report["recording"]) == ("ended by the keyboard", 0, "")


def test_nobody_arms_by_waiting(tmp_path: Path) -> None:
    class Waits(Person):
        def poll(self, now_s: float) -> Hands:
            return Hands(arm=now_s > 105.0, end=now_s > 105.5)

    assert deploy(tmp_path, Waits())["figures"]["time_s"] == pytest.approx(0.5, abs=0.05)


def test_letting_the_dead_mans_button_go_ends_the_drive(tmp_path: Path) -> None:
    report = deploy(tmp_path, Person(lambda now: Hands(holds=now < 1.0), "gamepad"), must_hold=True)
    assert report["ended_by"] == "the dead man's button of the gamepad was let go"
    assert report["figures"]["time_s"] == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_ends_the_drive(tmp_path: Path, number: signal.Signals) -> None:
    def send(now: float) -> Hands:
        if 0.99 < now < 1.001:
            os.kill(os.getpid(), number)
        return Hands()

    report = deploy(tmp_path, Person(send))
    assert report["ended_by"] == number.name
    assert report["figures"]["time_s"] == pytest.approx(1.0, abs=0.03)


def test_a_fault_of_the_car_stops_it_and_is_no_error_of_the_program(tmp_path: Path) -> None:
    def silent(driven: float, readings: dict[str, float]) -> dict[str, float]:
        return readings | {"ultrasonic_front_age": max(driven - 0.5, 0.0)}

    report = deploy(tmp_path, Person(), sensors=Rolling(silent), faults=FaultLimits())
    assert report["failed"]
    assert report["ended_by"].startswith("STOP sonar silent: front, for 0.5 s")
    assert report["ended_by"] in read(tmp_path / "out" / "drive.mcap").words


def test_a_warning_is_told_once_and_recorded(tmp_path: Path) -> None:
    def low(driven: float, readings: dict[str, float]) -> dict[str, float]:
        return readings | {"battery": 6.5 - 0.01 * driven}

    words = Words()
    report = deploy(tmp_path, Person(), sensors=Rolling(low), faults=FaultLimits(), console=words)
    assert [warning.split(":")[0] for warning in report["warnings"]] == ["WARN battery low"]
    assert [text for text in words.said if text.startswith("WARN")] == report["warnings"]
    assert report["warnings"][0] in read(tmp_path / "out" / "drive.mcap").words


def test_a_policy_that_fails_stops_the_car_and_the_summary_says_so(tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match="no idea"):
        deploy(tmp_path, Person(), name="Failing")
    report = json.loads((tmp_path / "out" / SUMMARY).read_text())
    assert report["failed"]
    assert report["ended_by"].startswith("PolicyError: ")


def test_a_full_disk_does_not_hide_what_the_policy_did_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tral_fsm.evaluation.files.write_json", full)
    with pytest.raises(PolicyError, match="no idea") as raised:
        deploy(tmp_path, Person(), name="Failing")
    assert "The summary could not be written either: [Errno 28] No space left on device" in raised.value.__notes__
    with pytest.raises(OSError, match="No space left on device"):
        deploy(tmp_path, Person())


def test_a_policy_that_needs_what_the_car_does_not_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="needs gate_id"):
        deploy(tmp_path, Person(), name="Hungry")


def test_the_preflight_is_told_and_refuses(tmp_path: Path) -> None:
    words, found = Words(), [Finding(what="srf08", told="left 0.80 m"), Finding(what="board log")]
    options = {"dry": False, "check": lambda car: [*found, Finding(what="battery", problem="5.20 V is too low")]}
    with pytest.raises(HardwareError, match=r"the pre-flight refuses this car:\n  battery: 5.20 V is too low"):
        deploy(tmp_path, Person(), console=words, **options)
    assert words.said == [
        "pre-flight, srf08: left 0.80 m",
        "pre-flight, board log: ok",
        "pre-flight, battery: 5.20 V is too low",
    ]
    assert not (tmp_path / "out").exists()


def test_lateness_is_of_the_ticks(tmp_path: Path) -> None:
    report = deploy(tmp_path, Person(), max_duration_s=1.0)
    assert report["figures"]["lateness_ms"] == {"p50": pytest.approx(0.0, abs=1e-6)} | dict.fromkeys(
        ("p99", "max"), pytest.approx(0.0, abs=1e-6)
    )


@pytest.mark.parametrize("seconds", [0.0, -1.0, np.nan])
def test_a_time_is_above_0(seconds: float) -> None:
    with pytest.raises(ConfigError, match="max_duration_s"):
        DeployArguments(policy="wall", config="car.toml", max_duration_s=seconds)
