"""A twin in a process of its own: it runs in real time, answers, fails on demand, and leaves nothing behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from tral_env.errors import ConfigError, HardwareError
from tral_env.hardware.actuator.settings import Limits
from tral_env.hardware.calibration_file import load_calibration
from tral_env.twin.control import ControlServer, ask
from tral_env.twin.devices import why_no_files
from tral_env.twin.hall import TwinHall
from tral_env.twin.running import TwinProcess
from tral_env.twin.settings import TwinSettings, runtime_folder


def settings(folder: Path, **more: object) -> TwinSettings:
    plain = {"scenario": "straight", "seed": 3, "bus": None, "folder": str(folder)}
    return TwinSettings(**{**plain, **more})  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TwinProcess]:
    folder = tmp_path_factory.mktemp("run") / "twin"
    with TwinProcess(settings(folder)) as twin:
        yield twin
    assert not folder.exists()
    assert str(folder) not in Path("/proc/mounts").read_text()


def test_it_tells_where_its_devices_are(twin: TwinProcess) -> None:
    status = twin.first_status
    assert Path(status["hall"]).is_socket()
    assert set(status["serial"]) == {"board2016", "ucboard"}
    assert all(Path(path).exists() for path in status["serial"].values())
    if reason := why_no_files():
        assert (status["i2c"], status["why_no_files"]) == (None, reason)
    else:
        assert Path(status["i2c"]).exists()


def test_it_runs_in_real_time_and_tells_its_lateness(twin: TwinProcess) -> None:
    before, begun_s = twin.status(), time.monotonic()
    time.sleep(0.5)
    after, took_s = twin.status(), time.monotonic() - begun_s
    drove_s = after["truth"]["time_s"] - before["truth"]["time_s"]
    lost_s = after["lateness"]["lost_s"] - before["lateness"]["lost_s"]
    assert drove_s + lost_s == pytest.approx(took_s, abs=0.25)
    lateness = after["lateness"]
    assert 0.0 <= lateness["late_p50_ms"] <= lateness["late_p99_ms"] <= lateness["late_max_ms"]


def test_a_reset_begins_a_new_drive(twin: TwinProcess) -> None:
    twin.reset(4)
    status = twin.status()
    assert status["seed"] == 4
    assert status["truth"]["time_s"] < 5.0
    assert twin.outcome() is None


def test_faults_begin_and_end(twin: TwinProcess) -> None:
    twin.fault("bus-stuck", seconds=60.0)
    assert list(twin.status()["faults"]) == ["bus-stuck"]
    twin.fault("bus-stuck", off=True)
    twin.fault("hall-off")
    assert twin.status()["faults"] == {"hall-off": None}
    twin.fault("hall-off", off=True)
    with pytest.raises(ConfigError, match="unknown fault"):
        twin.fault("fire")


def test_a_fault_may_begin_later(twin: TwinProcess) -> None:
    twin.fault("hall-off", after=0.3, seconds=60.0)
    assert twin.status()["faults"] == {}
    until_s = time.monotonic() + 10.0
    while not twin.status()["faults"]:
        assert time.monotonic() < until_s
        time.sleep(0.05)
    twin.fault("hall-off", off=True)


@pytest.mark.usefixtures("device_files")
def test_the_cars_own_program_drives_it_through_its_files(twin: TwinProcess) -> None:
    status = twin.status()
    calibration = load_calibration("tt01").model_copy(
        update={"oscillator_hz": float(status["oscillator_hz"]), "clock_measured": True}
    )
    car = gym.make(
        "tral_env:TralCar-v0",
        calibration=calibration,
        output="pca9685",
        sensors="srf08",
        bus=status["i2c"],
        max_duration_s=2.0,
        limits=Limits(silence_s=0.5, off_s=2.0, max_age_s=0.5, bus_s=0.5, hang_s=0.5),  # a busy computer may be late
    )
    try:
        observation, _ = car.reset()
        ended, seen = False, []
        while not ended:
            observation, _, _, ended, info = car.step(np.array([0.5, 0.0]))
            if info["tick"] % 10 == 0:
                status = twin.status()
                seen.append((status["controller_armed"], status["steering_us"], status["throttle_us"]))
        assert (True, pytest.approx(1385.0, abs=2.5), pytest.approx(1530.0, abs=2.5)) in seen
        assert observation[0] < 6.0 or observation[2] < 6.0  # a wall beside the car
    finally:
        car.close()
    after = twin.status()
    assert (after["steering_us"], after["throttle_us"]) == (0.0, 0.0)


def test_serial_ports_come_and_go(twin: TwinProcess) -> None:
    path = Path(twin.first_status["serial"]["board2016"])
    twin.fault("serial-unplugged")
    assert not path.exists()
    twin.fault("serial-unplugged", off=True)
    assert path.exists()


@pytest.mark.usefixtures("device_files")
def test_a_full_disk_takes_no_byte(twin: TwinProcess) -> None:
    disk = twin.folder / "disk"
    twin.fault("disk-full")
    with pytest.raises(OSError, match="No space left"):
        (disk / "recording").write_bytes(b"1")
    twin.fault("disk-full", off=True)
    (disk / "recording").unlink(missing_ok=True)
    (disk / "recording").write_bytes(b"1")


def test_requests_that_nobody_understands_are_refused(twin: TwinProcess) -> None:
    with pytest.raises(ConfigError, match="unknown request 'stats': did you mean 'status'"):
        twin.ask("stats")
    with pytest.raises(ConfigError):
        twin.ask("reset")


def test_a_second_twin_of_the_same_folder_is_refused(twin: TwinProcess) -> None:
    with pytest.raises(HardwareError, match="a twin runs already"):
        TwinProcess(twin.settings)


@pytest.mark.parametrize("place", ["long" * 30, "file/below"])
def test_a_folder_in_which_no_twin_can_listen_is_told(place: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(HardwareError, match=r"no twin can listen at .*: give it another folder or name"):
        ControlServer(tmp_path / place / "control", {})


def test_a_hall_counter_connects(twin: TwinProcess) -> None:
    hall = TwinHall(Path(twin.first_status["hall"]))
    hall.start()
    assert hall.read(time.monotonic())["distance"] == 0.0
    hall.stop()


def test_without_a_twin_nobody_answers(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match="tral twin up"):
        ask(tmp_path, do="status")
    assert runtime_folder("x") != runtime_folder("y")


def test_a_twin_that_cannot_be_built_says_why(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match=r"nowhere\.json"):
        TwinProcess(settings(tmp_path / "run", course="nowhere.json"))


STARTER = """
import sys, time
from tral_env.twin.running import TwinProcess
from tral_env.twin.settings import TwinSettings
twin = TwinProcess(TwinSettings.from_json(sys.argv[1]))
print(twin.pid, flush=True)
time.sleep(60)
"""


@pytest.mark.parametrize("killed", ["the starter", "the twin"])
def test_a_killed_process_leaves_no_twin_and_no_mount(tmp_path: Path, killed: str) -> None:
    folder = tmp_path / "twin"
    starter = subprocess.Popen(
        [sys.executable, "-c", STARTER, settings(folder).to_json()], stdout=subprocess.PIPE, text=True
    )
    assert starter.stdout is not None
    pid = int(starter.stdout.readline())
    os.kill(starter.pid if killed == "the starter" else pid, signal.SIGKILL)
    until_s = time.monotonic() + 10.0
    while str(folder) in Path("/proc/mounts").read_text() or answers(folder):
        assert time.monotonic() < until_s
        time.sleep(0.05)
    starter.kill()
    starter.wait()
    starter.stdout.close()


def answers(folder: Path) -> bool:
    try:
        ask(folder, do="status")
    except (HardwareError, ConfigError):
        return False
    return True
