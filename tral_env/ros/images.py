"""Where the camera node has its images from: a camera of this computer, or an MJPEG stream such as the twin's."""

from __future__ import annotations

import time
import urllib.request
from http.client import HTTPException, HTTPResponse
from typing import Any, NamedTuple, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.errors import HardwareError
from tral_env.hardware.camera import open_capture, require_size
from tral_env.hardware.camera_options import CameraOptions

_TIMEOUT_S = 2.0
_QUALITY = 85
"""Quality of the JPEG of a camera without JPEGs, in percent. Source: choice."""
_MAX_BYTES = 20_000_000
_EXPOSURE = "x-exposure-ns"
_DIRECT = urllib.request.build_opener(urllib.request.ProxyHandler({}))
"""Asks a camera itself, whatever proxy the environment names for web pages."""


class Exposed(NamedTuple):
    """An image."""

    jpeg: bytes
    grey: NDArray[np.uint8]
    """(height, width)"""
    exposed_ns: int
    """Time of exposure, ns of ROS."""


class Images(Protocol):
    """A source of images."""

    def next(self) -> Exposed | None:
        """Wait for the next image; None: it could not be read.

        Raises:
            HardwareError: the camera is gone.
        """
        ...

    def close(self) -> None:
        """Let go of the camera."""


class CameraImages:
    """A camera that OpenCV opens."""

    def __init__(self, options: CameraOptions) -> None:
        """Open it.

        Raises:
            HardwareError: it cannot be opened.
        """
        self._options = options
        self._capture: Any = open_capture(options)
        self._failures = 0

    def next(self) -> Exposed | None:
        """See `Images.next`."""
        whole = self._capture.grab()
        exposed_ns = time.time_ns() - round(self._options.latency_s * 1e9)
        image = self._capture.retrieve()[1] if whole else None
        if image is None:
            self._failures += 1
            if self._failures > _TIMEOUT_S * self._options.rate_hz:
                raise HardwareError(f"the camera {self._options.device} gives no image: is its plug in?")
            time.sleep(1.0 / self._options.rate_hz)
            return None
        self._failures = 0
        require_size(image, self._options)
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image, np.uint8)
        _, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        return Exposed(jpeg.tobytes(), grey, exposed_ns)

    def close(self) -> None:
        """See `Images.close`."""
        self._capture.release()


class StreamImages:
    """An MJPEG stream over HTTP. A part may have the header X-Exposure-Ns, on the monotonic clock of this computer."""

    def __init__(self, url: str, latency_s: float = 0.0) -> None:
        """Connect.

        Args:
            url: such as http://127.0.0.1:8080/stream.mjpg.
            latency_s: from exposure until an image is here, for parts without the header, s.

        Raises:
            HardwareError: no answer.
        """
        self._url, self._latency_ns = url, round(latency_s * 1e9)
        try:
            self._stream: HTTPResponse = _DIRECT.open(url, timeout=_TIMEOUT_S)
        except (OSError, ValueError) as error:
            raise HardwareError(f"the camera {url} does not answer: {error}") from error

    def next(self) -> Exposed | None:
        """See `Images.next`."""
        try:
            headers = self._headers()
            size = int(headers.get("content-length", "0"))
            if not 0 < size <= _MAX_BYTES:
                raise HardwareError(f"the camera {self._url} sends no MJPEG: a part without its length")
            exposed = int(headers.get(_EXPOSURE, "-1"))
            jpeg = self._stream.read(size)
        except (OSError, HTTPException, ValueError) as error:
            if isinstance(error, HardwareError):
                raise
            raise HardwareError(f"the camera {self._url} is gone: {error}") from error
        now_ns = time.time_ns()
        age_ns = self._latency_ns if exposed < 0 else max(time.monotonic_ns() - exposed, 0)
        grey = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
        return None if grey is None else Exposed(jpeg, np.asarray(grey, np.uint8), now_ns - age_ns)

    def close(self) -> None:
        """See `Images.close`."""
        self._stream.close()

    def _headers(self) -> dict[str, str]:
        """The headers of the next part; its boundary and empty lines before are passed over."""
        found: dict[str, str] = {}
        while line := self._stream.readline(1000):
            name, colon, value = line.decode("latin-1").strip().partition(":")
            if colon:
                found[name.lower()] = value.strip()
            elif found and not name:
                return found
        raise HardwareError(f"the camera {self._url} is gone: the stream has ended")
