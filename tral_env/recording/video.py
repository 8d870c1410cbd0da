"""Videos: H.264 in mp4 files, written picture by picture."""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.errors import RenderError

CODEC = "libx264"
_AHEAD = 4
"""Pictures may wait for the encoder, so many; then the caller waits. Source: choice, 5 MB of 848 x 480 px."""
_NO_ENCODER = (
    "no encoder for videos ({}): pip install --force-reinstall av, or do without: tral drive --no-video, "
    "tral compare --videos 0"
)


def encoder() -> str:
    """The encoder of this computer, for people to read.

    Raises:
        RenderError: there is none.
    """
    av = _av()
    if CODEC not in av.codecs_available:
        raise RenderError(_NO_ENCODER.format(f"PyAV {av.__version__} has no {CODEC}"))
    return f"{CODEC} of PyAV {av.__version__}"


def _av() -> Any:
    try:
        import av
    except ImportError as error:
        raise RenderError(_NO_ENCODER.format(error)) from error
    return av


class VideoWriter:
    """Writes an mp4 file; without a picture no file begins. A thread encodes while the caller makes the next picture.

    Example:
        with VideoWriter(path, fps=16, quality=24) as video:
            video.add(image)
    """

    def __init__(
        self, path: Path, *, fps: int, quality: float, preset: str = "veryfast", key_every: int | None = None
    ) -> None:
        """Look for the encoder.

        Args:
            path: the file; one that exists is replaced.
            fps: pictures per second.
            quality: constant rate factor of x264: 0 loses nothing, 51 is the worst; 6 more halve the file.
            preset: of x264, how much computing makes the file smaller.
            key_every: distance between two pictures that need no other one; None: as the encoder chooses.

        Raises:
            RenderError: there is no encoder.
        """
        encoder()
        self._path, self._fps = path, fps
        self._options = {"crf": f"{quality:g}", "preset": preset}
        if key_every is not None:
            self._options["g"] = str(key_every)
        self._file: Any = None
        self._thread = ThreadPoolExecutor(1, "encoder")
        self._pending: deque[Future[None]] = deque()

    def add(self, image: NDArray[np.uint8]) -> None:
        """Add a picture, (height, width, 3) RGB; all of a video have the size of the first one.

        Raises:
            OSError: the file cannot be written; an earlier picture may have been the first one.
        """
        av = _av()
        if self._file is None:
            self._begin(av, *image.shape[:2])
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
        self._pending.append(self._thread.submit(self._encode, frame))
        self._wait(_AHEAD)

    def _encode(self, frame: Any) -> None:
        stream = self._stream
        smooth = frame.reformat(stream.width, stream.height, "yuv420p", interpolation="BICUBIC")
        self._file.mux(stream.encode(smooth))

    def _wait(self, pending: int) -> None:
        """Wait until at most so many pictures are pending."""
        while len(self._pending) > pending:
            self._pending.popleft().result()

    def _begin(self, av: Any, height: int, width: int) -> None:
        # The index first, so that a browser shows the film while it loads.
        self._file = av.open(str(self._path), "w", format="mp4", options={"movflags": "+faststart"})
        self._stream = self._file.add_stream(CODEC, rate=self._fps, options=self._options)
        # Colours have half the resolution: an odd size grows by a pixel.
        self._stream.width, self._stream.height = width + width % 2, height + height % 2
        self._stream.pix_fmt = "yuv420p"
        # More threads compute more.
        self._stream.codec_context.thread_count = 1

    def close(self) -> None:
        """Finish the file.

        Raises:
            OSError: the file cannot be written.
        """
        try:
            self._wait(0)
            if self._file is not None:
                self._file.mux(self._stream.encode())
        finally:
            self._thread.shutdown(cancel_futures=True)
            self._pending.clear()
            file, self._file = self._file, None
            if file is not None:
                file.close()

    def __enter__(self) -> VideoWriter:
        """Return the writer."""
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        """Finish the file."""
        self.close()
