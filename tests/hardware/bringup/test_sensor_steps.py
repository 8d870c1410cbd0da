"""The guided steps of the sensors: a wheel turned by hand, a hand before each ultrasonic, a camera and its lens."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from workbench import FILE, Script, Workbench, car_file

from tral_env.calibration.camera_info import write_camera_info
from tral_env.config import CameraConfig
from tral_env.errors import ConfigError, HardwareError
from tral_env.hardware import camera
from tral_env.hardware.bringup.guide import calibrate
from tral_env.hardware.car_file import CarFile, load_car
from tral_env.hardware.hall_line import HallOptions
from tral_env.hardware.sensor_drivers import Srf08Options
from tral_env.hardware.serial_sensors import Board2016SensorOptions

HALL = '[[sensors]]\ndriver = "hall"\n'
SONARS = '[[sensors]]\ndriver = "srf08"\n'
OLD_BOARD = '[[sensors]]\ndriver = "board2016"\nport = "/dev/ttyUSB0"\n'


class FakeSensors:
    """Sensors that read what a test says, at a time since their start."""

    provided_readings = frozenset({"distance", "speed", *(f"ultrasonic_{side}" for side in ("left", "front", "right"))})

    def __init__(self, bench: Workbench, readings: Callable[[float], Mapping[str, float]]) -> None:
        self.bench, self.readings, self.stopped, self.begun = bench, readings, 0, 0.0

    def start(self) -> None:
        self.begun = self.bench.clock()

    def read(self, now: float) -> Mapping[str, float]:
        return self.readings(now - self.begun)

    def stop(self) -> None:
        self.stopped += 1


@pytest.fixture
def bench() -> Workbench:
    return Workbench()


def done(folder: Path, bench: Workbench, step: str, *answers: Any, text: str) -> tuple[CarFile, Script]:
    script = Script(answers)
    path = car_file(folder, text)
    calibrate(path, script.person, bench.bench, [step])
    assert bench.rests
    return load_car(path), script


def turned(metres: float) -> Callable[[float], Mapping[str, float]]:
    """A wheel that is turned from the second second on, within ten seconds."""
    return lambda past_s: {"distance": metres * min(max((past_s - 2.0) / 10.0, 0.0), 1.0)}


@pytest.mark.parametrize(
    ("kind", "text", "path", "before"),
    [
        (HallOptions, HALL, "metres_per_tick", 0.02513),
        (Board2016SensorOptions, OLD_BOARD, "units_per_m", 937.5),
    ],
)
def test_ten_turns_of_the_wheel_correct_the_way_of_a_count(
    tmp_path: Path, bench: Workbench, monkeypatch: Any, kind: Any, text: str, path: str, before: float
) -> None:
    monkeypatch.setattr(kind, "open", lambda options, clock, sleep: FakeSensors(bench, turned(2.2)))
    car, script = done(tmp_path, bench, "hall", "200", "", "y", text=FILE + text)
    assert "the sensor told 2.200 m, the wheel went 2.000 m" in script.told
    factor = 2.0 / 2.2 if path == "metres_per_tick" else 2.2 / 2.0
    assert getattr(car.sensors[0].options, path) == pytest.approx(before * factor, abs=1e-5)


def test_a_sensor_that_tells_nothing_and_a_correction_that_is_refused_are_tried_again(
    tmp_path: Path, bench: Workbench, monkeypatch: Any
) -> None:
    tries = iter([turned(0.0), turned(5.0), turned(2.0)])
    monkeypatch.setattr(HallOptions, "open", lambda options, clock, sleep: FakeSensors(bench, next(tries)))
    car, script = done(tmp_path, bench, "hall", "200 mm", "", "", "n", "", "y", text=FILE + HALL)
    assert "no edge came: check the sensor's supply and its pin" in script.told
    assert car.sensors[0].options.metres_per_tick == pytest.approx(0.02513)


def hand(side: str, others: float = 2.0) -> Callable[[float], Mapping[str, float]]:
    """A hand that comes before one ultrasonic after two seconds."""

    def read(past_s: float) -> Mapping[str, float]:
        far = {f"ultrasonic_{each}": others for each in ("left", "front", "right")}
        return far | ({f"ultrasonic_{side}": 0.3} if past_s > 2.0 else {})

    return read


class Rangers:
    """Opens ultrasonics before which hands are held, one after the other."""

    def __init__(self, bench: Workbench, *hands: Callable[[float], Mapping[str, float]]) -> None:
        self.bench, self.hands, self.opened = bench, [lambda past_s: {}, *hands], []

    def open(self, options: object, clock: object, sleep: object) -> FakeSensors:
        self.opened.append(FakeSensors(self.bench, self.hands[len(self.opened)]))
        return self.opened[-1]


def held(bench: Workbench, monkeypatch: Any, *hands: Any, kind: Any = Srf08Options) -> Rangers:
    rangers = Rangers(bench, *hands)
    monkeypatch.setattr(kind, "open", lambda options, clock, sleep: rangers.open(options, clock, sleep))
    return rangers


def test_each_ultrasonic_that_hears_its_own_hand_is_right(tmp_path: Path, bench: Workbench, monkeypatch: Any) -> None:
    rangers = held(bench, monkeypatch, hand("left"), hand("front"), hand("right"))
    car, script = done(tmp_path, bench, "sonars", "", "", "", text=FILE + SONARS)
    assert script.said.count("  the left ultrasonic heard it") == 1
    assert car.sensors == load_car(car_file(tmp_path, FILE + SONARS)).sensors
    assert all(each.stopped == 1 for each in rangers.opened)


def test_ultrasonics_whose_plugs_are_mixed_up_change_their_addresses(
    tmp_path: Path, bench: Workbench, monkeypatch: Any
) -> None:
    held(bench, monkeypatch, hand("front"), hand("left"), hand("right"))
    car, script = done(tmp_path, bench, "sonars", "", "", "", text=FILE + SONARS)
    assert "the front ultrasonic heard it, not the left one" in script.told
    assert car.sensors[0].options.addresses == {"left": 0x71, "front": 0x70, "right": 0x72}


def test_a_hand_that_nobody_hears_is_waited_for_again(tmp_path: Path, bench: Workbench, monkeypatch: Any) -> None:
    held(bench, monkeypatch, lambda past_s: {}, hand("left"), hand("front"), hand("right"))
    _, script = done(tmp_path, bench, "sonars", "", "", "", "", text=FILE + SONARS)
    assert "no ultrasonic heard a hand within 15 s" in script.told


def test_what_stood_near_before_is_no_hand(tmp_path: Path, bench: Workbench, monkeypatch: Any) -> None:
    held(bench, monkeypatch, hand("left", others=0.4), hand("left"), hand("front"), hand("right"))
    _, script = done(tmp_path, bench, "sonars", "", "", "", "", text=FILE + SONARS)
    assert "no ultrasonic heard a hand within 15 s" in script.told


@pytest.mark.parametrize(
    ("kind", "text", "hands"),
    [
        (Board2016SensorOptions, OLD_BOARD, ("front", "left", "right")),
        (Srf08Options, SONARS, ("front", "front", "right")),
    ],
)
def test_a_mixture_that_addresses_cannot_mend_is_told(
    tmp_path: Path, bench: Workbench, monkeypatch: Any, kind: Any, text: str, hands: tuple[str, ...]
) -> None:
    held(bench, monkeypatch, *map(hand, hands), kind=kind)
    with pytest.raises(HardwareError, match="mixed up: change their plugs"):
        done(tmp_path, bench, "sonars", "", "", "", text=FILE + text)


class Webcam:
    """A camera that gives an image every 40 ms."""

    def __init__(self, bench: Workbench, size: tuple[int, int] = (640, 480)) -> None:
        self.bench, self.size, self.next_s = bench, size, 0.0
        self.released = False
        self.blind = False

    def read(self) -> tuple[bool, Any]:
        if self.blind or self.bench.clock() < self.next_s:
            return False, None
        self.next_s = self.bench.clock() + 0.04
        return True, np.zeros((self.size[1], self.size[0], 3), np.uint8)

    def release(self) -> None:
        self.released = True


@pytest.fixture
def webcam(bench: Workbench, monkeypatch: pytest.MonkeyPatch) -> Webcam:
    made = Webcam(bench)
    monkeypatch.setattr(camera, "open_capture", lambda options: made)
    return made


def test_the_camera_is_seen_to_work_and_its_lens_is_taken(
    tmp_path: Path, bench: Workbench, webcam: Webcam, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The lens is typed as it is seen from the folder of the terminal, and stands in the file as seen from there."""
    here = tmp_path / "here"
    (here / "Lens").mkdir(parents=True)
    monkeypatch.chdir(here)
    write_camera_info(here / "Lens" / "camera_info.yaml", CameraConfig(), "webcam")
    write_camera_info(here / "big.yaml", CameraConfig().scaled(1280, 960), "webcam")
    answers = ("none.yaml", "big.yaml", "Lens/camera_info.yaml")
    car, script = done(tmp_path, bench, "camera", *answers, text=FILE + "[camera]\ndevice = 2\n")
    assert car.camera is not None
    assert car.camera.lens == str(here / "Lens" / "camera_info.yaml")
    assert 'lens = "here/Lens/camera_info.yaml"' in (tmp_path / "car.toml").read_text()
    assert "20 images a second of 640 x 480 px" in script.told
    assert "tral calibrate /dev/video2 --out runs/lens" in script.told
    assert "cannot read the lens" in script.told
    assert "is for images of 1280 x 960 px, the camera gives 640 x 480" in script.told
    assert webcam.released
    assert bench.opened == [], "a camera needs no board"


def test_a_camera_of_another_size_is_told(tmp_path: Path, bench: Workbench, webcam: Webcam) -> None:
    webcam.size = (320, 240)
    with pytest.raises(ConfigError, match="gives images of 320 x 240 px, the car file says 640 x 480"):
        done(tmp_path, bench, "camera", text=FILE + "[camera]\n")


def test_a_camera_that_sees_nothing_is_told(tmp_path: Path, bench: Workbench, webcam: Webcam) -> None:
    webcam.blind = True
    with pytest.raises(HardwareError, match="the camera /dev/v gave no image within 2 s"):
        done(tmp_path, bench, "camera", text=FILE + '[camera]\ndevice = "/dev/v"\n')
