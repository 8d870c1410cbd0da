"""The twin's camera: MJPEG that OpenCV opens, each image with the time of its exposure."""

import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from tral_env.perception.aruco import Detector
from tral_env.twin.camera import PICTURE, STREAM, exposure_ns, stamped
from tral_env.twin.running import TwinProcess
from tral_env.twin.settings import TwinSettings

pytestmark = [pytest.mark.usefixtures("opengl"), pytest.mark.slow]


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TwinProcess]:
    folder = tmp_path_factory.mktemp("run") / "twin"
    settings = TwinSettings(
        scenario="gates", seed=3, bus=None, files=False, serial=False, camera=True, folder=str(folder)
    )
    with TwinProcess(settings) as twin:
        yield twin


def picture(twin: TwinProcess) -> bytes:
    with urllib.request.urlopen(twin.first_status["camera"].replace(STREAM, PICTURE)) as answer:
        image: bytes = answer.read()
        assert int(answer.headers["X-Exposure-Ns"]) == exposure_ns(image)
    return image


def test_opencv_opens_the_stream(twin: TwinProcess) -> None:
    capture = cv2.VideoCapture(twin.first_status["camera"])
    assert capture.isOpened()
    came, image = capture.read()
    begun_s = time.monotonic()
    for _ in range(30):
        came, image = capture.read()
    rate_hz = 30 / (time.monotonic() - begun_s)
    capture.release()
    assert came
    assert image.shape == (480, 640, 3)
    assert rate_hz < 25.0  # 15 on a computer that is not busy; OpenCV may hold some images back first
    assert len(Detector().detect(image).ids) >= 2  # the posts of a gate


def test_an_image_tells_when_it_was_exposed(twin: TwinProcess) -> None:
    first, now_ns = exposure_ns(picture(twin)), time.monotonic_ns()
    assert first is not None
    assert 0 < now_ns - first < 2_000_000_000
    time.sleep(0.3)
    second = exposure_ns(picture(twin))
    assert second is not None
    assert second > first


def test_a_stamp_leaves_the_image_as_it_is() -> None:
    _, encoded = cv2.imencode(".jpg", np.full((8, 8, 3), 100, np.uint8))
    jpeg = encoded.tobytes()
    assert exposure_ns(jpeg) is None
    assert exposure_ns(stamped(jpeg, 123)) == 123
    decoded = cv2.imdecode(np.frombuffer(stamped(jpeg, 123), np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(decoded, cv2.imdecode(encoded, cv2.IMREAD_COLOR))


def test_a_frozen_camera_sends_the_same_image_with_new_times(twin: TwinProcess) -> None:
    twin.fault("camera-frozen")
    time.sleep(0.5)
    first = picture(twin)
    time.sleep(0.3)
    second = picture(twin)
    twin.fault("camera-frozen", off=True)
    assert exposure_ns(first) != exposure_ns(second)
    assert first[60:] == second[60:]


def test_a_camera_that_is_gone_takes_no_connection_and_comes_back(twin: TwinProcess) -> None:
    twin.fault("camera-gone")
    time.sleep(1.0)
    with pytest.raises(urllib.error.URLError):
        picture(twin)
    twin.fault("camera-gone", off=True)
    time.sleep(1.0)
    assert exposure_ns(picture(twin))
    with pytest.raises(urllib.error.HTTPError):
        urllib.request.urlopen(twin.first_status["camera"].replace(STREAM, "/other"))


def test_another_course_is_seen_after_a_reset(twin: TwinProcess) -> None:
    before = picture(twin)
    twin.reset(4)
    time.sleep(0.5)
    assert picture(twin)[60:] != before[60:]
    assert Path(twin.folder).exists()
