"""The camera that looks ahead: images in a thread, and the same gate and marker readings as in simulation."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import number
from tral_env.config import CarConfig
from tral_env.errors import ConfigError, HardwareError
from tral_env.hardware.camera_options import CameraOptions
from tral_env.hardware.physical import Physical
from tral_env.hardware.sensors import ImageLog, ImageTimes, ImageWatcher
from tral_env.perception.aruco import Detector, marker_poses
from tral_env.perception.camera_pipeline import QUANTITIES, SUBJECTS, CameraPipeline
from tral_env.perception.gate import nearest_in_image

_PATIENCE_S = 1.0
"""A camera that gives no image for longer counts as lost."""
_RETRY_S = 0.05
"""After an image that could not be read, the thread waits this long."""
_END_S = 2.0
"""The thread ends within this time: after the image that it waits for."""
_ONE_CAR = np.array([0])
CAPTURE = cv2.VideoCapture
"""Opens a camera by number, path or URL."""


class Camera(Physical):
    """Gate and marker readings as `Sensors`.

    A thread takes each image as soon as it comes and looks for markers, because a driver's queue of old images would
    add to their age. What was seen stays until something newer is seen, and its age grows, as in simulation.
    """

    provided_readings = frozenset(f"{subject}_{what}" for subject in SUBJECTS for what in (*QUANTITIES, "age"))

    def __init__(self, options: CameraOptions, clock: Callable[[], float] = time.monotonic) -> None:
        """Open the camera.

        Raises:
            CalibrationError: the file of the lens cannot be used.
            ConfigError: the lens is for images of another size.
            HardwareError: the camera cannot be opened, or gives images of another size.
        """
        self._options, self._clock = options, clock
        self._lens = options.calibrated()
        self._car = replace(CarConfig(), camera_x=options.forward)
        self._detector = Detector()
        self._capture: Any = open_capture(options)
        self._lock, self._ends = threading.Lock(), threading.Event()
        self._pipeline = CameraPipeline(1, options.rate_hz)
        self._pipeline.reset(_ONE_CAR, np.zeros(1))
        self._failure: Exception | None = None
        self.images = 0
        """Number of images since the camera was opened."""
        self._log = ImageLog(clock())
        self._watcher: ImageWatcher | None = None
        # It begins here, long before a car is armed: a camera takes a while until its first image.
        self._thread = threading.Thread(target=self._watch, name="tral-camera", daemon=True)
        self._thread.start()

    def watch_images(self, watcher: ImageWatcher) -> None:
        """Call a watcher with each image; the camera's thread calls it."""
        self._watcher = watcher

    def start(self) -> None:
        """Forget what was seen."""
        with self._lock:
            self._pipeline.reset(_ONE_CAR, np.zeros(1))
            self._log.reset(self._clock())

    def read(self, now: float) -> Mapping[str, float]:
        """Give the gate and the marker that were seen last; see `Sensors.read`."""
        with self._lock:
            failure, waited_s = self._failure, now - self._log.times.exposed_s
            readings = self._pipeline.readings(np.array([now]))
        if failure is not None:
            raise HardwareError(f"the camera {self._options.device} failed: {failure}") from failure
        if waited_s > _PATIENCE_S + self._options.latency_s:
            raise HardwareError(f"the camera {self._options.device} has given no image for {waited_s:.1f} s")
        return {name: float(number(value)) for name, value in readings.items()}

    @property
    def image_times(self) -> ImageTimes:
        """Times of the images."""
        with self._lock:
            return self._log.times

    def stop(self) -> None:
        """End the thread and let go of the camera; a second call does nothing."""
        self._ends.set()
        self._thread.join(_END_S)
        self._capture.release()

    def _watch(self) -> None:
        """Take images until the end."""
        while not self._ends.is_set():
            try:
                self._take()
            except Exception as error:  # told by the next reading, in the thread that drives
                with self._lock:
                    self._failure = error
                return

    def _take(self) -> None:
        """Wait for an image, and look at it; one that could not be read is passed over."""
        if not self._capture.grab():
            self._ends.wait(_RETRY_S)
            return
        exposed_s = self._clock() - self._options.latency_s
        whole, image = self._capture.retrieve()
        if whole:
            self._look(image, exposed_s)

    def _look(self, image: NDArray[np.uint8], exposed_s: float) -> None:
        """Look for markers in an image, and note what was seen."""
        require_size(image, self._options)
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image, np.uint8)
        seen = nearest_in_image(marker_poses(self._detector.detect(grey), self._lens, self._car))
        with self._lock:
            self.images += 1
            self._log.note(grey, exposed_s)
            self._pipeline.expose(_ONE_CAR, np.array([exposed_s]), seen)
            self._pipeline.deliver(np.array([exposed_s]))
        if self._watcher is not None:
            pixels = cv2.cvtColor(image, cv2.COLOR_BGR2RGB) if image.ndim == 3 else image
            self._watcher(exposed_s, np.asarray(pixels, np.uint8))


def open_capture(options: CameraOptions) -> Any:
    """Open a camera, as OpenCV's ``VideoCapture``, and ask it for size and rate.

    Raises:
        HardwareError: it cannot be opened.
    """
    capture = CAPTURE(options.device)
    if not capture.isOpened():
        capture.release()
        raise HardwareError(
            f"cannot open the camera {options.device}: is its plug in, and does no other program use it? `v4l2-ctl "
            "--list-devices` lists the cameras; add the user to the group video"
        )
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, options.width)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, options.height)
    capture.set(cv2.CAP_PROP_FPS, options.rate_hz)
    capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
    return capture


def require_size(image: NDArray[np.uint8], options: CameraOptions) -> None:
    """Refuse an image of another size than the camera file says.

    Raises:
        ConfigError: another size.
    """
    height, width = image.shape[:2]
    if (width, height) != (options.width, options.height):
        raise ConfigError(
            f"it gives images of {width} x {height} px, the car file says {options.width} x {options.height}: choose a "
            "size that it has (`v4l2-ctl --list-formats-ext`), and calibrate the lens with it"
        )
