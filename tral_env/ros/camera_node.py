"""The node `camera`: images, the lens, and what the images show of gates and markers."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace

from tral_env.arrays import number
from tral_env.config import CameraConfig, CarConfig
from tral_env.errors import ConfigError, HardwareError
from tral_env.hardware.faults import FaultLimits
from tral_env.perception.aruco import Detector, marker_poses
from tral_env.perception.gate import Detection, nearest_in_image
from tral_env.ros import topics
from tral_env.ros.diagnostics import FAILED, OK, WARNING, Diagnostics, in_words
from tral_env.ros.image_guard import ImageGuard
from tral_env.ros.images import Exposed, Images, StreamImages
from tral_env.ros.msg.sensor import CameraInfo, CompressedImage, JointState
from tral_env.ros.msg.std import Bool, Header, String
from tral_env.ros.msg.vision import Detection3DArray
from tral_env.ros.node import ERROR, INFO, WARN, Node
from tral_env.ros.qos import LATCHED, SEEN, SENSOR_DATA, STATE
from tral_env.ros.readings import MessageReadings, detections_of
from tral_env.ros.times import stamp

_RETRY_S = 0.5
"""A camera that is gone is opened again this often, s."""
_JUDGE_S = 0.05
"""While the car drives, its images are judged this often, s."""
_SILENT_S = 1.0
"""A camera that gave no image for so long is no camera that looks, s. Source: choice."""
_SPEED_S = 0.2
"""A speed that was told longer ago is that of a car whose node is gone, s."""


@dataclass(frozen=True, kw_only=True)
class CameraNodeOptions:
    """Parameters of the node."""

    namespace: str = ""
    lens: CameraConfig = CameraConfig()  # noqa: RUF009 - frozen
    forward: float = CarConfig.camera_x
    """The camera stands this far ahead of the rear axle, m."""
    faults: FaultLimits = FaultLimits()  # noqa: RUF009 - frozen
    """When images are too old or too long the same; see docs/safety.md."""


class CameraNode:
    """Looks for markers in each image as soon as it comes.

    While the car is armed, a thread judges the images: when they are too old, or the same while the car moves, it stops
    the car, whatever the policy is.
    """

    def __init__(self, open_images: Callable[[], Images] | None, options: CameraNodeOptions | None = None) -> None:
        """Open the topics.

        Args:
            open_images: opens the camera; None: a simulated car tells where its images are, on the topic camera/url.
            options: of the node.
        """
        self.options = options or CameraNodeOptions()
        self._open = open_images
        self.node = node = Node("camera", namespace=self.options.namespace)
        self._url = node.subscription(topics.CAMERA_URL, String, LATCHED, wakes=True) if open_images is None else None
        self._image = node.publisher(topics.IMAGE, CompressedImage, SENSOR_DATA)
        self._info = node.publisher(topics.CAMERA_INFO, CameraInfo, SENSOR_DATA)
        self._seen = node.publisher(topics.DETECTIONS, Detection3DArray, SEEN)
        self._detector, self._car = Detector(), replace(CarConfig(), camera_x=self.options.forward)
        self._last_url = ""
        self._armed_topic = node.subscription(topics.ARMED, Bool, replace(LATCHED, depth=10))
        self._joints = node.subscription(topics.JOINTS, JointState, STATE)
        self._arm = node.publisher(topics.ARM, Bool, STATE)
        self._diagnostics = Diagnostics(node, "images")
        self._guard, self._readings = ImageGuard(self.options.faults), MessageReadings()
        self._armed, self._why = False, ""
        self._said: set[str] = set()
        self._told_s = self._seen_s = 0.0
        self._failure: Exception | None = None
        self.images = self.unreadable = 0
        """Number of images until now, and of those that were none."""

    def run(self, ended: threading.Event) -> None:
        """Look until the event is set; a camera that is gone is opened again."""
        guard = threading.Thread(target=self._judge_until, args=(ended,))
        guard.start()
        try:
            while not ended.is_set():
                try:
                    self._watch(ended)
                except HardwareError as error:
                    self._say(str(error), WARN)
                    ended.wait(_RETRY_S)
        finally:
            ended.set()
            guard.join()
            self.node.log(in_words(self.figures))
            self.node.close()
        if self._failure is not None:
            raise self._failure

    @property
    def figures(self) -> dict[str, object]:
        """What came of the images until now."""
        return {"images": self.images, "unreadable images": self.unreadable}

    def judge(self) -> None:
        """Stop the car if its images cannot be trusted any more."""
        for armed in self._armed_topic.take():
            if armed.data and not self._armed:
                self._guard.begin()
                self._why = ""
            self._armed = armed.data
        if self._armed and not self._why and (fault := self._guard.judge(self.speed())):
            self._why = str(fault)
            self.node.log(f"stops the car: {fault}", ERROR)
            self._diagnostics.hurry()
        if self._armed and self._why:  # a message may be lost: again, until the car tells that it is not armed
            self._arm.publish(Bool(False))
        if self._diagnostics.due:
            self._diagnose()

    def speed(self) -> float:
        """Speed of the car, m/s; one that nobody tells any more counts as standstill: its images are then the same."""
        now_s = time.monotonic()
        for joints in self._joints.take():
            self._readings.hear(joints)
            self._told_s = now_s
        is_old = now_s - self._told_s > _SPEED_S
        return 0.0 if is_old else self._readings.readings(time.time_ns()).get("speed", 0.0)

    def look(self, image: Exposed) -> None:
        """Tell an image, and what it shows.

        Raises:
            ConfigError: the image has another size than those of the lens.
        """
        lens = self.options.lens
        if image.grey.shape != (lens.height, lens.width):
            height, width = image.grey.shape
            raise ConfigError(
                f"the images are {width} x {height} px, those of the lens {lens.width} x {lens.height} px: let the "
                "camera give such images, or calibrate it with its own, by `tral calibrate`"
            )
        self.images += 1
        self._seen_s = time.monotonic()
        self._guard.note(image.grey, (time.time_ns() - image.exposed_ns) / 1e9)
        seen = nearest_in_image(marker_poses(self._detector.detect(image.grey), lens, self._car))
        self._seen.publish(detections_of(_named(seen), image.exposed_ns))
        header = Header(stamp(image.exposed_ns), topics.CAMERA_OPTICAL)
        self._info.publish(camera_info(lens, header))
        if self._image.listeners:
            self._image.publish(CompressedImage(header, "jpeg", image.jpeg))

    def _say(self, text: str, level: int = INFO) -> None:
        """Log something once until another image comes."""
        if text not in self._said:
            self._said.add(text)
            self.node.log(text, level)

    def _judge_until(self, ended: threading.Event) -> None:
        """Judge until the event is set; where that fails, the node ends: nobody watches its images any more."""
        try:
            while not ended.wait(_JUDGE_S):
                self.judge()
        except Exception as error:
            self._failure = error
        finally:
            ended.set()

    def _diagnose(self) -> None:
        if self._why:
            level, message = FAILED, f"stopped the car: {self._why}"
        elif not self.images:
            level, message = WARNING, "no image yet"
        elif time.monotonic() - self._seen_s > _SILENT_S:
            level, message = WARNING, f"no image for over {_SILENT_S:g} s"
        else:
            level, message = OK, "looks"
        self._diagnostics.tell(time.time_ns(), level, message, self.figures)

    def _watch(self, ended: threading.Event) -> None:
        images = self._open() if self._open is not None else self._simulated(ended)
        if images is None:
            return
        try:
            while not ended.is_set():
                if (image := images.next()) is not None:
                    self._said.clear()
                    self.look(image)
                else:
                    self.unreadable += 1
        finally:
            images.close()

    def _simulated(self, ended: threading.Event) -> Images | None:
        """The images of a simulated car, once it tells where they are."""
        assert self._url is not None
        self._say("waiting for a simulated car with --camera rendered")
        while not ended.is_set():
            for message in self._url.take():
                self._last_url = message.data
            if self._last_url:
                return StreamImages(self._last_url)
            self.node.wait(0.1)
        return None


def camera_info(lens: CameraConfig, header: Header) -> CameraInfo:
    """A lens as a message."""
    fx, fy, cx, cy = lens.fx, lens.fy, lens.cx, lens.cy
    return CameraInfo(
        header, lens.height, lens.width, "plumb_bob", list(lens.distortion),
        [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )  # fmt: skip


def _named(seen: Detection) -> dict[str, float]:
    return {field.name: float(number(getattr(seen, field.name))) for field in fields(seen)}
