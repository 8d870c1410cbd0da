"""The recorder of a drive. The control loop hands it what happened and never waits; a thread writes the file."""

from __future__ import annotations

import atexit
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tral_env.checks import one_of
from tral_env.errors import ConfigError, reason
from tral_env.interface import CORE_LAYOUT, Layout
from tral_env.recording.about import digest, versions
from tral_env.recording.file import RecordingFile
from tral_env.recording.messages import Encoder, ImageItem, Item, RecordedTick, SensorFrame, Word
from tral_env.recording.topics import LEVELS

SYNC_S = 0.25
"""The disk has everything that is older than this, as long as it is not slower itself."""
MAX_WAITING = 8192
"""So many ticks, frames and words may wait for the disk: ticks of 100 s. What comes then is dropped."""
MAX_WAITING_IMAGES = 64
"""So many images may wait: those of 4 s."""
_WAKE_S = 0.02
"""The thread looks for work this often. Work in small portions keeps the interpreter free for the control loop."""
_END_S = 10.0
"""`close` waits so long for the disk."""
ABOUT = "tral"
"""Name of the metadata that tell what was driven."""
_log = logging.getLogger("tral_env.recording")


_Waiting = tuple[int, type[Item], tuple[Any, ...]]
"""What waits: its calendar time, ns since 1970, its kind, and its fields."""


class _Queue:
    """What waits for the thread. Nobody waits for it: what finds it full is dropped and counted."""

    def __init__(self, room: int) -> None:
        self._room, self._items, self.dropped = room, deque[_Waiting](), 0

    def put(self, item: _Waiting) -> None:
        """Hand over an item, or drop it."""
        if len(self._items) < self._room:
            self._items.append(item)
        else:
            self.dropped += 1

    def take(self) -> Iterator[_Waiting]:
        """Take the items that wait now."""
        for _ in range(len(self._items)):
            yield self._items.popleft()


class Recorder:
    """Records one drive into one MCAP file.

    Each method only puts what it is given into a queue, which takes some microseconds. A thread makes JSON and JPEG of
    it, writes, and brings all on the disk four times a second. So a process that is killed, or a computer that loses
    its power, loses the last part of a second, and the rest can be read with `tral_env.recording.read.read`. A disk
    that is full ends the recording, not the drive: `failure` says why, and so does a line of the log.

    Example:
        with Recorder(Path("drive.mcap")) as recorder:
            recorder.tick(time_s=0.0, observation=observation, action=action)
    """

    def __init__(
        self,
        path: Path | str,
        *,
        source: str = "car",
        layout: Layout = CORE_LAYOUT,
        configuration: Mapping[str, object] | None = None,
        files: Mapping[str, bytes] | None = None,
        start_s: float = 0.0,
        wall_ns: Callable[[], int] = time.time_ns,
        open_file: Callable[[Path], RecordingFile] = RecordingFile,
    ) -> None:
        """Make the file, and write what is known before the drive.

        Args:
            path: the file; it must not exist.
            source: what drives: "car" or "simulation".
            layout: columns of the observations.
            configuration: what the drive can be repeated with, name -> anything that JSON has.
            files: files to keep within the file, name -> content: the calibration, the policy.
            start_s: the time of the start on the clock of the drive, s.
            wall_ns: calendar time, ns since 1970.
            open_file: makes the file.

        Raises:
            ConfigError: the file exists or cannot be written, or the source is unknown.
        """
        one_of("source", source, ("car", "simulation"))
        self.path, self._start_s, self._wall_ns = Path(path), start_s, wall_ns
        self.failure = ""
        """Why the recording has ended early; empty: it has not."""
        self.refused = 0
        """Number of items that could not be made into messages, such as an image of a wrong shape."""
        self._ticks, self._queue, self._images = 0, _Queue(MAX_WAITING), _Queue(MAX_WAITING_IMAGES)
        start_ns = wall_ns()
        self._encoder = Encoder(layout, start_ns)
        self._file = open_file(self.path)
        about = {"source": source, "fields": list(layout.names), "start_s": start_s, "start_ns": start_ns}
        self._write_head({**about, "versions": versions(), "configuration": dict(configuration or {})}, files or {})
        self._ends, self._closed = threading.Event(), False
        self.say(start_s, "the recording begins")
        self._thread = threading.Thread(target=self._write_all, name="tral recorder", daemon=True)
        self._thread.start()
        atexit.register(self.close)

    @property
    def dropped(self) -> int:
        """Number of ticks, images, frames and words that found no room, because the disk was too slow."""
        return self._queue.dropped + self._images.dropped

    def tick(
        self,
        *,
        time_s: float,
        observation: NDArray[np.float32],
        action: NDArray[np.floating] | tuple[float, float],
        applied: tuple[float, float] | None = None,
        pulses_us: tuple[float, float] | None = None,
        late_ticks: int = 0,
        lateness_s: float = 0.0,
        state: str = "",
        wanted: tuple[float, float] | None = None,
        transitions: Iterable[Any] = (),
        truth: Mapping[str, Any] | None = None,
    ) -> None:
        """Record a step of the control loop.

        Args:
            time_s: the end of the step on the clock of the drive, s.
            observation: (d,) what the policy was told.
            action: (2,) what it answered: steering, throttle.
            applied: steering and throttle after all limits; None: not known.
            pulses_us: pulses of servo and motor controller, us; None: there are none.
            late_ticks: number of late steps so far.
            lateness_s: time by which this step came too late, s.
            state: name of the state that acted.
            wanted: side of the followed wall, +1 left, -1 right, and the wanted clearance [m]; NaN: none.
            transitions: those that fired, as `tral_fsm.runtime.machine.Transit`.
            truth: ground truth after the step by name, which must not change any more.
        """
        # A plain tuple and the bytes of the arrays: after the sleep of a control loop all code is cold, and a tuple
        # with names and two casts would take twice as long as the rest.
        observed = observation if isinstance(observation, np.ndarray) else np.asarray(observation)
        answered = action if isinstance(action, np.ndarray) else np.asarray(action)
        self._put(
            self._queue,
            RecordedTick,
            (
                self._ticks,
                time_s - self._start_s,
                time_s,
                observed.tobytes(),
                observed.dtype,
                answered.tobytes(),
                answered.dtype,
                applied,
                pulses_us,
                late_ticks,
                lateness_s,
                state,
                wanted,
                tuple(transitions),
                truth,
            ),
        )
        self._ticks += 1

    def image(self, time_s: float, pixels: NDArray[np.uint8] | bytes, camera: str = "camera") -> None:
        """Record an image; another thread than that of the control loop may call it.

        Args:
            time_s: time of its exposure on the clock of the drive, s.
            pixels: (height, width, 3) RGB or (height, width) grey, which must not change any more; or a JPEG file.
            camera: name of the camera.
        """
        self._put(self._images, ImageItem, (time_s - self._start_s, pixels, camera))

    def frame(self, time_s: float, source: str, data: bytes) -> None:
        """Record bytes of a sensor as they came, before anything was made of them.

        Args:
            time_s: time on the clock of the drive, s.
            source: name of the sensor.
            data: the bytes.
        """
        self._put(self._queue, SensorFrame, (time_s - self._start_s, source, data))

    def say(self, time_s: float, text: str, level: str = "info") -> None:
        """Record a word about the drive.

        Args:
            time_s: time on the clock of the drive, s.
            text: the word.
            level: "info", "warning" or "error".
        """
        one_of("level", level, LEVELS)
        self._put(self._queue, Word, (time_s - self._start_s, text, level))

    def close(self) -> None:
        """Write what waits, and the index; a second call does nothing. An error of the disk stands in `failure`."""
        if self._closed:
            return
        self._closed = True
        self._ends.set()
        self._thread.join(_END_S)
        atexit.unregister(self.close)
        if self._thread.is_alive():
            self._fail(f"the disk did not take the end of the recording within {_END_S:g} s")

    def __enter__(self) -> Self:
        """The recorder."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        """Close the file, whatever happened."""
        self.close()

    def _write_head(self, about: Mapping[str, object], files: Mapping[str, bytes]) -> None:
        """Write what is known before the drive.

        Raises:
            ConfigError: the disk does not take it.
        """
        try:
            self._file.metadata(ABOUT, about)
            self._file.metadata("sha256", {name: digest(data) for name, data in files.items()})
            for name, data in files.items():
                media_type = "application/json" if name.endswith(".json") else "application/octet-stream"
                self._file.attach(name, data, media_type, self._encoder.log_ns(0.0))
            self._file.sync()
        except OSError as error:
            self._file.abandon()
            raise ConfigError(f"recording {self.path}: {error.strerror}: choose another disk") from error
        except (TypeError, ValueError) as error:
            self._file.abandon()
            raise ConfigError(f"recording {self.path}: the configuration is nothing that JSON has: {error}") from error

    def _put(self, queue: _Queue, kind: type[Item], fields: tuple[Any, ...]) -> None:
        if not (self.failure or self._closed):
            queue.put((self._wall_ns(), kind, fields))

    def _write_all(self) -> None:
        """Write until the end, or until the disk refuses."""
        try:
            synced_s, ends = time.monotonic(), False
            while not ends:
                ends = self._ends.wait(_WAKE_S)
                self._write_waiting()
                if time.monotonic() - synced_s >= SYNC_S:
                    self._file.sync()
                    synced_s = time.monotonic()
            self._tell_end()
            self._file.finish()
        except Exception as error:  # a thread that dies without a word would lose the drive in silence
            self._give_up(error)

    def _write_waiting(self) -> None:
        for queue in (self._queue, self._images):
            for wall_ns, kind, fields in queue.take():
                item = kind._make(fields)
                try:
                    messages, log_ns = list(self._encoder.messages(item)), self._encoder.log_ns(item.time_s)
                except Exception as error:  # whatever is wrong with one item, the others are recorded
                    self._refuse(item, error)
                    continue
                for topic, data in messages:
                    self._file.message(topic, data, log_ns, wall_ns)

    def _refuse(self, item: Item, error: Exception) -> None:
        """Count an item that no message can be made of, and tell the first."""
        self.refused += 1
        if self.refused == 1:
            _log.error("%s: a %s cannot be recorded: %s", self.path, type(item).__name__, reason(error))

    def _tell_end(self) -> None:
        dropped = {"ticks": self._queue.dropped, "images": self._images.dropped}
        self._file.metadata("end", {"ticks": self._ticks, "dropped": dropped, "refused": self.refused})
        if self.dropped:
            _log.warning("%s: the disk was too slow: %d messages were dropped", self.path, self.dropped)

    def _give_up(self, error: Exception) -> None:
        why = error.strerror if isinstance(error, OSError) and error.strerror else reason(error)
        self._fail(f"{why}: the recording ended after {self._ticks} ticks, the drive goes on")
        try:
            self._file.abandon()
        except OSError as second:
            _log.error("%s: %s", self.path, second.strerror)

    def _fail(self, why: str) -> None:
        self.failure = f"recording {self.path}: {why}"
        _log.error(self.failure)
