"""The node `camera`: a stream of images, when they were exposed, and what is told of them."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer

import cv2
import numpy as np
import pytest
from test_ros_nodes import until

from tral_env.config import CameraConfig
from tral_env.errors import HardwareError
from tral_env.ros import topics
from tral_env.ros.camera_node import CameraNode, camera_info
from tral_env.ros.images import StreamImages
from tral_env.ros.msg.sensor import CompressedImage
from tral_env.ros.msg.std import Header
from tral_env.ros.msg.vision import Detection3DArray
from tral_env.ros.node import Node
from tral_env.ros.qos import SEEN, SENSOR_DATA
from tral_env.ros.times import nanoseconds

JPEG = cv2.imencode(".jpg", np.full((480, 640), 90, np.uint8))[1].tobytes()


class Stream(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()
        for _ in range(3):
            exposed = f"X-Exposure-Ns: {time.monotonic_ns() - 50_000_000}\r\n"
            head = f"--exposure\r\nContent-Type: image/jpeg\r\nContent-Length: {len(JPEG)}\r\n{exposed}\r\n"
            self.wfile.write(head.encode() + JPEG + b"\r\n")

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def url() -> Iterator[str]:
    with HTTPServer(("127.0.0.1", 0), Stream) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}/stream.mjpg"
        server.shutdown()
        thread.join()


def test_images_come_with_the_time_of_their_exposure_until_the_stream_ends(url: str) -> None:
    images = StreamImages(url)
    for _ in range(3):
        image = images.next()
        assert image is not None
        assert image.jpeg == JPEG
        assert image.grey.shape == (480, 640)
        assert image.exposed_ns <= time.time_ns() - 50_000_000
    with pytest.raises(HardwareError, match="the stream has ended"):
        images.next()
    images.close()


def test_a_camera_that_is_not_there_is_told() -> None:
    with pytest.raises(HardwareError, match="does not answer"):
        StreamImages("http://127.0.0.1:9/stream.mjpg")


def test_an_empty_image_is_told_too(url: str) -> None:
    probe = Node("probe")
    seen = probe.subscription(topics.DETECTIONS, Detection3DArray, SEEN)
    jpegs = probe.subscription(topics.IMAGE, CompressedImage, SENSOR_DATA)
    node = CameraNode(lambda: StreamImages(url))
    until(lambda: node._image.listeners and node._seen.listeners)
    images = StreamImages(url)
    image = images.next()
    assert image is not None
    node.look(image)
    (told,) = until(seen.take)
    assert list(told.detections) == []
    assert nanoseconds(told.header.stamp) == image.exposed_ns
    assert bytes(until(jpegs.take)[0].data) == JPEG
    images.close()
    node.node.close()
    probe.close()


def test_the_lens_is_told_as_ros_has_it() -> None:
    told = camera_info(CameraConfig(), Header())
    assert told.k[0] == told.p[0] == CameraConfig.fx
    assert (told.width, told.height, told.distortion_model) == (640, 480, "plumb_bob")


@pytest.mark.parametrize("header", ["X-Exposure-Ns: soon", "Content-Length: many"])
def test_a_part_with_a_header_that_is_no_number_is_told(header: str, monkeypatch: pytest.MonkeyPatch, url: str) -> None:
    images = StreamImages(url)
    name, _, value = header.partition(": ")
    monkeypatch.setattr(images, "_headers", lambda: {"content-length": "9", name.lower(): value})
    with pytest.raises(HardwareError, match="is gone: invalid literal"):
        images.next()
    images.close()


def test_a_camera_is_asked_itself_whatever_proxy_web_pages_take(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:9")
    monkeypatch.delenv("no_proxy", raising=False)
    images = StreamImages(url)
    assert images.next() is not None
    images.close()
