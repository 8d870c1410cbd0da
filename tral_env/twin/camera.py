"""The camera of the twin: a process that renders what it sees and serves it as MJPEG over loopback.

The twin's process hands it states on its standard input; it renders the newest one. Each part of the stream has the
time of exposure on CLOCK_MONOTONIC as a header, ``X-Exposure-Ns``, and as a comment inside the JPEG.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import IO, Any, NoReturn

import cv2

from tral_env.arrays import Array, Image
from tral_env.config import CameraConfig
from tral_env.course.plan import Plan
from tral_env.course.scene import Pool
from tral_env.errors import RenderError, TralError
from tral_env.perception.degrade import ImageCorruption
from tral_env.simulation.vision import Webcam

CAMERA = "camera"
"""The argument of ``python -m tral_env.twin`` that makes it the camera's process."""
IMAGE_RATE_HZ = 15.0
_END_S = 2.0
"""The camera's process ends within this time, or it is killed."""
QUALITY = 80
"""Quality of the JPEG, in percent. Source: choice, that of common webcams."""
STREAM, PICTURE = "/stream.mjpg", "/image.jpg"
_BOUNDARY = "exposure"
_DETECTION_S = 0.01
"""Of the latency from exposure to detection, the detection takes this part, s. Source: choice."""
_SLOW_S = 2.0
"""A reader that waits longer than this for an image is let go."""
_COMMENT = b"exposure_ns="


@dataclass(frozen=True, eq=False)
class RenderSetup:
    """What stands around the camera."""

    pool: Pool
    plan: Plan
    lens: CameraConfig
    faults: ImageCorruption
    degradation: float
    seed: int
    latency_s: float
    """From exposure to detection, s."""


@dataclass(frozen=True, eq=False)
class RenderRequest:
    """A state to render, and how the camera does."""

    exposed_ns: int
    qpos: Array
    mounting: Array
    gone: bool = False
    frozen: bool = False


def stamped(jpeg: bytes, exposed_ns: int) -> bytes:
    """A JPEG with the time of its exposure as a comment."""
    text = _COMMENT + str(exposed_ns).encode()
    return jpeg[:2] + b"\xff\xfe" + (len(text) + 2).to_bytes(2, "big") + text + jpeg[2:]


def exposure_ns(jpeg: bytes) -> int | None:
    """The time of exposure of an image of the twin, ns on CLOCK_MONOTONIC; None: it is no such image."""
    place = jpeg[:256].find(_COMMENT)
    if place < 0:
        return None
    length = int.from_bytes(jpeg[place - 2 : place], "big") - 2
    return int(jpeg[place + len(_COMMENT) : place + length])


class NewestImage:
    """The newest image, and the threads that wait for it."""

    def __init__(self) -> None:
        """No image yet."""
        self._changed = threading.Condition()
        self._jpeg, self._count = b"", 0
        self.exposed_ns = 0
        self.gone = False

    def put(self, jpeg: bytes, exposed_ns: int) -> None:
        """Show an image."""
        with self._changed:
            self._jpeg, self.exposed_ns = jpeg, exposed_ns
            self._count += 1
            self._changed.notify_all()

    def after(self, count: int, patience_s: float = _SLOW_S) -> tuple[bytes, int, int] | None:
        """The newest image that is later than the count-th, with its time and count; None: none came, or it is gone."""
        with self._changed:
            came = self._changed.wait_for(lambda: self._count > count or self.gone, patience_s)
            return (self._jpeg, self.exposed_ns, self._count) if came and not self.gone else None


class _Handler(BaseHTTPRequestHandler):
    frames: NewestImage

    def do_GET(self) -> None:
        """Answer with the stream or with one image."""
        if self.path not in (STREAM, PICTURE):
            return self.send_error(404)
        with suppress(OSError):
            self._picture() if self.path == PICTURE else self._stream()
        return None

    def log_message(self, *_: Any) -> None:
        """Say nothing."""

    def _picture(self) -> None:
        if (frame := self.frames.after(0)) is None:
            return self.send_error(503)
        self.send_response(200)
        self._image(*frame[:2])
        return None

    def _stream(self) -> None:
        count = 0
        self.send_response(200)
        self.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={_BOUNDARY}")
        self.end_headers()
        while (frame := self.frames.after(count)) is not None:
            jpeg, exposed_ns, count = frame
            self.wfile.write(f"--{_BOUNDARY}\r\n".encode())
            self._image(jpeg, exposed_ns)
            self.wfile.write(b"\r\n")

    def _image(self, jpeg: bytes, exposed_ns: int) -> None:
        self.send_header("Content-Type", "image/jpeg")
        self.send_header("Content-Length", str(len(jpeg)))
        self.send_header("X-Exposure-Ns", str(exposed_ns))
        self.end_headers()
        self.wfile.write(jpeg)


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, frames: NewestImage, port: int = 0) -> None:
        super().__init__(("127.0.0.1", port), type("Handler", (_Handler,), {"frames": frames}))
        threading.Thread(target=self.serve_forever, daemon=True).start()


class _Eye:
    """Renders what is asked for, with the setup that was given last."""

    def __init__(self) -> None:
        self._webcam: Webcam | None = None
        self._setup: RenderSetup | None = None
        self._kept: Image | None = None

    def place(self, setup: RenderSetup) -> None:
        """Put a scene around the camera."""
        if self._webcam is None or self._setup is None or self._setup.pool != setup.pool:
            if self._webcam is not None:
                self._webcam.close()
            self._webcam = Webcam(1, setup.pool, setup.lens, setup.faults)
        self._webcam.place(0, setup.plan, setup.degradation, setup.seed)
        self._setup = setup

    def look(self, request: RenderRequest) -> tuple[bytes, float] | None:
        """The JPEG of what is asked for, and the time until it may be seen, s; None: nothing to see yet."""
        if self._webcam is None or self._setup is None:
            return None
        if self._kept is None or not request.frozen:
            self._kept = self._webcam.image(0, request.qpos, request.mounting)
        _, jpeg = cv2.imencode(".jpg", self._kept[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        return stamped(jpeg.tobytes(), request.exposed_ns), max(self._setup.latency_s - _DETECTION_S, 0.0)


class _Newest:
    """What came last on a pipe: a setup is never lost, a request gives way to a newer one."""

    def __init__(self, pipe: IO[bytes]) -> None:
        self._pipe, self._changed = pipe, threading.Condition()
        self._setup: RenderSetup | None = None
        self._request: RenderRequest | None = None
        self._ended = False
        threading.Thread(target=self._read, daemon=True).start()

    def take(self) -> tuple[RenderSetup | None, RenderRequest | None] | None:
        """Wait for something new; None: the pipe has ended."""
        with self._changed:
            self._changed.wait_for(lambda: self._request or self._setup or self._ended)
            found, self._setup, self._request = (self._setup, self._request), None, None
            return None if self._ended else found

    def _read(self) -> None:
        while True:
            try:
                came = pickle.load(self._pipe)  # from the twin's own process alone
            except (EOFError, OSError, pickle.UnpicklingError):  # the twin ended, perhaps in the middle of a write
                came = None
            with self._changed:
                if isinstance(came, RenderSetup):
                    self._setup = came
                elif isinstance(came, RenderRequest):
                    self._request = came
                else:
                    self._ended = True
                self._changed.notify_all()
                if came is None:
                    return


def main() -> NoReturn:
    """Be the camera's process until the standard input ends."""
    frames, eye, newest = NewestImage(), _Eye(), _Newest(sys.stdin.buffer)
    server: _Server | None = _Server(frames)
    assert server is not None
    port = server.server_address[1]
    first = True
    while (came := newest.take()) is not None:
        setup, request = came
        try:
            if setup is not None:
                eye.place(setup)
            if request is None:
                continue
            seen = eye.look(request)
        except TralError as error:
            print(f"error: {error}", flush=True)
            os._exit(1)  # a thread still reads the pipe
        if first:
            print(port, flush=True)
            first = False
        server = _be_gone(server, frames, port, request.gone)
        if seen is not None:
            jpeg, latency_s = seen
            time.sleep(max(request.exposed_ns / 1e9 + latency_s - time.monotonic(), 0.0))
            frames.put(jpeg, request.exposed_ns)
    os._exit(0)


def _be_gone(server: _Server | None, frames: NewestImage, port: int, gone: bool) -> _Server | None:
    """End all connections and listen no more, or come back."""
    if gone and server is not None:
        frames.gone = True
        server.shutdown()
        server.server_close()
        return None
    if not gone and server is None:
        frames.gone = False
        return _Server(frames, port)
    return server


class CameraStream:
    """The twin's end: it starts the process, and hands it states."""

    def __init__(self, setup: RenderSetup, first: RenderRequest) -> None:
        """Start, and wait for the first image.

        Raises:
            RenderError: this computer cannot render.
        """
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tral_env.twin", CAMERA],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
        )  # fmt: skip
        self._due_s = 0.0
        self.place(setup)
        self._send(first)
        assert self._process.stdout is not None
        told = self._process.stdout.readline().decode().strip()
        if not told.isdecimal():
            self.close()
            raise RenderError(told.removeprefix("error: ") or "the camera's process ended: no OpenGL?")
        self.url = f"http://127.0.0.1:{told}{STREAM}"
        """What ``cv2.VideoCapture`` opens."""

    def place(self, setup: RenderSetup) -> None:
        """Put another scene around the camera."""
        self._send(setup)

    def is_due(self, now_s: float) -> bool:
        """Whether it is time for the next request, s."""
        return now_s >= self._due_s

    def expose(self, request: RenderRequest) -> None:
        """Take an image."""
        self._due_s = max(self._due_s + 1 / IMAGE_RATE_HZ, request.exposed_ns / 1e9)
        self._send(request)

    def close(self) -> None:
        """End the process."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _send(self, what: RenderSetup | RenderRequest) -> None:
        assert self._process.stdin is not None
        with suppress(BrokenPipeError, ValueError):
            pickle.dump(what, self._process.stdin)
            self._process.stdin.flush()
