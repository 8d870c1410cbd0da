"""The camera of the real car: images in a thread, the gate and marker readings of a policy, and what is refused."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from fakes import Clock
from numpy.typing import NDArray

from tral_env.calibration.camera_info import write_camera_info
from tral_env.config import CameraConfig, CarConfig
from tral_env.errors import CalibrationError, ConfigError, HardwareError
from tral_env.hardware import camera
from tral_env.hardware.camera import Camera
from tral_env.hardware.camera_options import CameraOptions
from tral_env.interface import CORE_FIELDS

LENS = CameraConfig()
Image = NDArray[np.uint8]


def picture(*markers: tuple[int, float, float]) -> Image:
    """Markers that face the camera: id, m ahead of the camera, m to the left."""
    image = np.full((LENS.height, LENS.width, 3), 120, np.uint8)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    for marker, ahead, left in markers:
        edge = round(LENS.fx * LENS.marker_size / ahead / 6) * 6
        code = np.pad(cv2.aruco.generateImageMarker(dictionary, marker, edge), edge // 6, constant_values=255)
        x, y = round(LENS.cx - LENS.fx * left / ahead), round(LENS.cy)
        top, start = y - len(code) // 2, x - len(code) // 2
        image[top : top + len(code), start : start + len(code)] = code[..., None]
    return image


class Webcam:
    """A camera that gives an image when the test hands it one."""

    def __init__(self, device: int | str = 0) -> None:
        self.device, self.opens = device, True
        self.asked: dict[int, float] = {}
        self.released = False
        self._image: Image | None = None
        self._handed, self._wanted = threading.Semaphore(0), threading.Semaphore(0)
        self.is_whole = True

    def isOpened(self) -> bool:  # noqa: N802
        return self.opens

    def set(self, what: int, value: float) -> None:
        self.asked[what] = value

    def grab(self) -> bool:
        self._wanted.release()
        return self._handed.acquire(timeout=5.0) and self._image is not None

    def retrieve(self) -> tuple[bool, Image | None]:
        return self.is_whole, self._image

    def release(self) -> None:
        self.released = True

    def hand(self, image: Image | None) -> None:
        """Hand an image over, and wait until the thread asks for the next one."""
        assert self._wanted.acquire(timeout=5.0)
        self._image = image
        self._handed.release()
        assert self._wanted.acquire(timeout=5.0)
        self._wanted.release()

    def hand_last(self, image: Image | None) -> None:
        """Hand an image over that may end the thread."""
        self._image = image
        self._handed.release()


@pytest.fixture
def webcam(monkeypatch: pytest.MonkeyPatch) -> Webcam:
    made = Webcam()
    monkeypatch.setattr(camera, "CAPTURE", lambda device: made)
    return made


@pytest.fixture
def lens(tmp_path: Path) -> str:
    write_camera_info(tmp_path / "camera_info.yaml", LENS, "webcam")
    return str(tmp_path / "camera_info.yaml")


@pytest.fixture
def started(webcam: Webcam, lens: str) -> Iterator[Callable[..., tuple[Any, Clock]]]:
    cameras = []

    def start(**options: Any) -> tuple[Any, Clock]:
        clock = Clock()
        made = Camera(CameraOptions(lens=lens, **options), clock)
        made.start()
        cameras.append(made)
        return made, clock

    yield start
    for each in cameras:
        webcam.hand_last(None)
        each.stop()


def test_before_the_first_image_nothing_is_seen(started: Any) -> None:
    seen, clock = started()
    readings = seen.read(clock())
    assert set(readings) == seen.provided_readings
    assert readings == {field.name: field.missing for field in CORE_FIELDS if field.name in readings}


def test_a_gate_is_where_it_stands_with_the_age_of_its_image(started: Any, webcam: Webcam) -> None:
    seen, clock = started(latency_s=0.04)
    webcam.hand(picture((6, 2.0, 0.5), (7, 2.0, -0.3)))
    clock.sleep(0.1)
    readings = seen.read(clock())
    assert (readings["gate_id"], readings["marker_id"]) == (3.0, 7.0)
    assert readings["gate_x"] == pytest.approx(2.0 + CarConfig.camera_x, abs=0.08)
    assert readings["gate_y"] == pytest.approx(0.1, abs=0.02)
    assert readings["gate_heading"] == pytest.approx(0.0, abs=0.1)
    assert readings["gate_age"] == readings["marker_age"] == pytest.approx(0.14)


def test_what_was_seen_stays_while_its_age_grows_and_a_start_forgets_it(started: Any, webcam: Webcam) -> None:
    seen, clock = started(forward=0.1)
    webcam.hand(picture((40, 1.0, 0.0)))
    for _ in range(3):
        clock.sleep(0.2)
        webcam.hand(picture())
    readings = seen.read(clock())
    assert readings["marker_id"] == 40.0
    assert readings["marker_x"] == pytest.approx(1.1, abs=0.03)
    assert readings["marker_age"] == pytest.approx(0.6)
    assert readings["gate_id"] == -1.0
    seen.start()
    assert seen.read(clock())["marker_id"] == -1.0


def test_a_camera_that_freezes_is_told_apart_from_one_that_sees_the_same(started: Any, webcam: Webcam) -> None:
    seen, clock = started()
    webcam.hand(picture())
    clock.sleep(0.5)
    webcam.hand(picture())
    assert (seen.images, clock() - seen.image_times.exposed_s, clock() - seen.image_times.changed_s) == (2, 0.0, 0.5)
    webcam.hand(picture((40, 1.0, 0.0)))
    assert clock() - seen.image_times.changed_s == 0.0


def test_a_camera_that_gives_no_image_is_told_after_a_second(started: Any, webcam: Webcam) -> None:
    seen, clock = started()
    webcam.hand(picture())
    clock.sleep(0.9)
    seen.read(clock())
    clock.sleep(0.2)
    with pytest.raises(HardwareError, match=r"the camera 0 has given no image for 1\.1 s"):
        seen.read(clock())
    seen.start()
    seen.read(clock())


def test_an_image_that_is_broken_is_passed_over(started: Any, webcam: Webcam) -> None:
    seen, _ = started()
    webcam.is_whole = False
    webcam.hand(picture((40, 1.0, 0.0)))
    assert seen.images == 0


def test_a_camera_that_gives_another_size_than_the_file_says_is_refused(started: Any, webcam: Webcam) -> None:
    seen, clock = started()
    webcam.hand_last(np.zeros((720, 1280, 3), np.uint8))
    for thread in threading.enumerate():
        if thread.name == "tral-camera":
            thread.join(5.0)
    with pytest.raises(HardwareError, match="gives images of 1280 x 720 px, the car file says 640 x 480"):
        seen.read(clock())


def test_a_grey_camera_is_read_too(started: Any, webcam: Webcam) -> None:
    seen, clock = started()
    webcam.hand(picture((41, 1.5, 0.0))[..., 0].copy())
    assert seen.read(clock())["marker_id"] == 41.0


def test_the_camera_is_asked_for_size_and_rate_and_for_no_queue(started: Any, webcam: Webcam) -> None:
    started(rate_hz=25.0)
    assert webcam.asked == {
        cv2.CAP_PROP_FRAME_WIDTH: 640,
        cv2.CAP_PROP_FRAME_HEIGHT: 480,
        cv2.CAP_PROP_FPS: 25.0,
        cv2.CAP_PROP_BUFFERSIZE: 1,
    }


def test_a_lens_of_another_image_size_is_refused(lens: str) -> None:
    with pytest.raises(ConfigError, match="is for images of 640 x 480 px, the camera gives 1280 x 720: calibrate it"):
        Camera(CameraOptions(lens=lens, width=1280, height=720))


def test_a_lens_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="cannot read the lens"):
        Camera(CameraOptions(lens=str(tmp_path / "lens.yaml")))


def test_a_camera_that_cannot_be_opened_is_told_with_what_to_do(webcam: Webcam, lens: str) -> None:
    webcam.opens = False
    with pytest.raises(HardwareError, match=r"cannot open the camera 0: .*v4l2-ctl.*group video"):
        Camera(CameraOptions(lens=lens))
    assert webcam.released


def test_a_camera_that_never_started_is_let_go(webcam: Webcam, lens: str) -> None:
    opened = Camera(CameraOptions(lens=lens))
    webcam.hand_last(None)
    opened.stop()
    assert webcam.released


def test_images_come_from_the_opening_on_so_that_a_slow_camera_is_awake_when_the_car_is_armed(
    webcam: Webcam, lens: str
) -> None:
    opened = Camera(CameraOptions(lens=lens), Clock())
    webcam.hand(picture((40, 1.0, 0.0)))
    assert opened.images == 1
    opened.start()
    webcam.hand(picture((41, 1.0, 0.0)))
    assert opened.read(100.0)["marker_id"] == 41.0
    webcam.hand_last(None)
    opened.stop()


def test_a_camera_whose_library_fails_is_told_with_its_words(
    started: Any, webcam: Webcam, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen, clock = started()
    webcam.hand(picture())

    def fail() -> Any:
        raise cv2.error("select() timeout")

    monkeypatch.setattr(webcam, "retrieve", fail)
    webcam.hand_last(picture())
    for thread in threading.enumerate():
        if thread.name == "tral-camera":
            thread.join(5.0)
    with pytest.raises(HardwareError, match=r"the camera 0 failed: select\(\) timeout"):
        seen.read(clock())


def test_images_can_be_watched_with_the_time_of_their_exposure(started: Any, webcam: Webcam) -> None:
    eye, clock = started()
    seen: list[tuple[float, Image]] = []
    eye.watch_images(lambda exposed_s, pixels: seen.append((exposed_s, pixels)))
    blue = picture()
    blue[...] = (255, 0, 0)  # OpenCV has blue first
    webcam.hand(blue)
    ((exposed_s, pixels),) = seen
    assert exposed_s == clock() - CameraOptions(lens="").latency_s
    assert pixels[0, 0].tolist() == [0, 0, 255]
