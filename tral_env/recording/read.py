"""Recordings as columns. A file without an end is read up to where it is torn."""

from __future__ import annotations

import base64
import json
import math
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import IO, Any, NamedTuple

import cv2
import numpy as np
from mcap.exceptions import EndOfFile, McapError
from mcap.records import Attachment, Channel, Chunk, DataEnd, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from numpy.typing import NDArray
from zstandard import ZstdError

from tral_env.arrays import Array
from tral_env.errors import BadFileError, ConfigError
from tral_env.interface import CORE_FIELDS, OPTIONAL_GROUPS, Layout
from tral_env.recording import topics
from tral_env.recording.file import PROFILE
from tral_env.recording.messages import SensorFrame
from tral_env.recording.recorder import ABOUT

_TORN = (McapError, EndOfFile, ZstdError, ValueError, struct.error)
"""What the library raises at bytes that are no record."""
_FIELDS = {field.name: field for field in (*CORE_FIELDS, *(one for group in OPTIONAL_GROUPS.values() for one in group))}


class RecordedTransition(NamedTuple):
    """A transition that fired; a `tral_fsm.runtime.machine.Transit` has the same fields behind the tick."""

    tick: int
    time: float
    path: tuple[str | int, ...]
    source: str | int
    target: str | int
    transition: str | int
    why: str


class RecordedImage(NamedTuple):
    """An image of a camera as a JPEG file; `time_s` is that of its exposure since the start, s."""

    time_s: float
    camera: str
    jpeg: bytes

    def pixels(self) -> NDArray[np.uint8]:
        """The image, (height, width, 3) RGB."""
        found: Any = cv2.imdecode(np.frombuffer(self.jpeg, np.uint8), cv2.IMREAD_COLOR)
        return np.asarray(cv2.cvtColor(found, cv2.COLOR_BGR2RGB), np.uint8)


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """One drive, T ticks. Row k of each column belongs to tick `tick[k]`; a tick that was dropped has no row."""

    path: Path
    about: Mapping[str, Any]
    """What was driven: `source`, `fields`, `versions`, `configuration`."""
    files: Mapping[str, bytes]
    """Files within the file: the calibration, the policy."""
    damage: str
    """Where and why the file is torn; empty: it is whole."""
    messages: Mapping[str, list[dict[str, Any]]] = field(repr=False)
    """Topic -> its messages, without images."""

    @property
    def source(self) -> str:
        """What drove: "car" or "simulation"."""
        return str(self.about["source"])

    @property
    def configuration(self) -> Mapping[str, Any]:
        """What the drive can be repeated with."""
        found: Mapping[str, Any] = self.about["configuration"]
        return found

    @cached_property
    def layout(self) -> Layout:
        """Columns of the observations."""
        return Layout(tuple(_FIELDS[name] for name in self.about["fields"]))

    @cached_property
    def tick(self) -> NDArray[np.int64]:
        """(T,) number of each tick; from 0 without a gap unless some were dropped."""
        told = {message["tick"] for message in self.messages.get(topics.ACTION.name, ())}
        ticks = [message["tick"] for message in self.messages.get("/observation", ()) if message["tick"] in told]
        return np.array(ticks, np.int64)

    @property
    def time_s(self) -> Array:
        """(T,) end of each tick since the start, s."""
        return self._numbers("/observation", "time_s")

    @property
    def clock_s(self) -> Array:
        """(T,) the same on the clock of the drive, s."""
        return self._numbers("/observation", "clock_s")

    @cached_property
    def observation(self) -> NDArray[np.float32]:
        """(T, d) what the policy was told, bit by bit."""
        columns = [self._numbers("/observation", name) for name in self.layout.names]
        return np.stack(columns, axis=1).astype(np.float32)

    @cached_property
    def action(self) -> Array:
        """(T, 2) what the policy answered: steering, throttle."""
        return self._pairs(topics.ACTION.name, "steering", "throttle")

    @cached_property
    def applied(self) -> Array:
        """(T, 2) steering and throttle after all limits; NaN: not known."""
        return self._pairs(topics.APPLIED.name, "steering", "throttle")

    @cached_property
    def pulses_us(self) -> Array:
        """(T, 2) pulses of servo and motor controller, us; NaN: there were none."""
        return self._pairs(topics.APPLIED.name, "steering_us", "throttle_us")

    @cached_property
    def lateness_s(self) -> Array:
        """(T,) time by which each tick came too late, s."""
        return self._numbers(topics.LOOP.name, "lateness_s")

    @cached_property
    def late_ticks(self) -> NDArray[np.int64]:
        """(T,) number of late ticks so far."""
        return self._numbers(topics.LOOP.name, "late_ticks").astype(np.int64)

    @cached_property
    def wanted(self) -> Array:
        """(T, 2) side of the followed wall, +1 left, -1 right, and the wanted clearance [m]; NaN: none."""
        return self._pairs(topics.STATE.name, "wanted_side", "wanted_clearance_m")

    @cached_property
    def states(self) -> tuple[str, ...]:
        """(T,) name of the state that acted; empty for a policy without states."""
        told = self._by_tick(topics.STATE.name)
        return tuple(told[tick]["state"] if tick in told else "" for tick in self.tick.tolist())

    @cached_property
    def transitions(self) -> tuple[RecordedTransition, ...]:
        """Transitions that fired, in their order."""
        return tuple(
            RecordedTransition(
                one["tick"], one["machine_time_s"], tuple(one["path"]), one["source"], one["target"],
                one["transition"], one["why"],
            )
            for one in self.messages.get(topics.TRANSITION.name, ())
        )  # fmt: skip

    @cached_property
    def truth(self) -> tuple[dict[str, Any], ...]:
        """(T,) ground truth after each tick, name -> value; nothing in the recording of a real car."""
        told = self._by_tick(topics.TRUTH)
        return tuple(told.get(tick, {}) for tick in self.tick.tolist())

    @cached_property
    def frames(self) -> tuple[SensorFrame, ...]:
        """Bytes of sensors as they came."""
        told = self.messages.get(topics.FRAME.name, ())
        return tuple(SensorFrame(one["time_s"], one["source"], base64.b64decode(one["data"])) for one in told)

    @property
    def words(self) -> tuple[str, ...]:
        """What was said about the drive."""
        return tuple(one["message"] for one in self.messages.get(topics.LOG.name, ()))

    def pictures(self) -> Iterator[RecordedImage]:
        """The images, one after the other; the file is read again."""
        for topic, data in _json_messages(self.path):
            if topic == topics.IMAGE.name:
                stamp = data["timestamp"]
                ns = stamp["sec"] * 10**9 + stamp["nsec"] - int(self.about["start_ns"])
                yield RecordedImage(ns / 1e9, data["frame_id"], base64.b64decode(data["data"]))

    def _by_tick(self, topic: str) -> dict[int, dict[str, Any]]:
        return {message["tick"]: message for message in self.messages.get(topic, ())}

    def _numbers(self, topic: str, name: str) -> Array:
        told, nothing = self._by_tick(topic), {name: math.nan}
        values = [told.get(tick, nothing).get(name) for tick in self.tick.tolist()]
        return np.array([math.nan if value is None else value for value in values], float)

    def _pairs(self, topic: str, first: str, second: str) -> Array:
        return np.stack([self._numbers(topic, first), self._numbers(topic, second)], axis=1)


def read(path: Path | str) -> Recording:
    """Read a recording; of a file that was torn, by a kill or a loss of power, what is whole.

    Raises:
        ConfigError: the file cannot be opened.
        BadFileError: it is no recording of a drive.
    """
    path = Path(path)
    about: dict[str, Any] = {}
    files: dict[str, bytes] = {}
    messages: dict[str, list[dict[str, Any]]] = {}
    with opened(path) as stream:
        scan = Scan(stream, path)
        for record in scan.records():
            if isinstance(record, Metadata):
                about |= _parsed(record) if record.name == ABOUT else {}
            elif isinstance(record, Attachment):
                files[record.name] = record.data
            elif isinstance(record, Message) and (topic := scan.topic(record)) != topics.IMAGE.name:
                messages.setdefault(topic, []).append(json.loads(record.data))
    if not about:
        raise BadFileError(f"{path}: an MCAP file, but no recording of a drive: it has no metadata '{ABOUT}'")
    return Recording(path=path, about=about, files=files, damage=scan.damage, messages=messages)


class _Bounded:
    """A file that gives no more than it has: a torn length may ask for more than the memory of the computer."""

    def __init__(self, stream: IO[bytes], size: int) -> None:
        self._stream, self._left = stream, size

    def read(self, length: int) -> bytes:
        """Read so many bytes, or those that are left."""
        data = self._stream.read(min(length, self._left))
        self._left -= len(data)
        return data


class Scan:
    """Goes through the records of a file, from the first to the last that is whole."""

    def __init__(self, stream: IO[bytes], path: Path) -> None:
        """Scan an open file."""
        self._stream, self._path = stream, path
        self._topics: dict[int, str] = {}
        self.damage = ""
        """Where and why the file is torn; empty so far: it is not."""

    def topic(self, message: Message) -> str:
        """Topic of a message that was met; empty: both places that name it are lost."""
        return self._topics.get(message.channel_id, "")

    def records(self, names: bool = False) -> Iterator[McapRecord]:
        """The messages, and what stands beside them.

        Args:
            names: whether schemas and channels are given, too, as often as they stand in the file.

        Raises:
            BadFileError: the file is no recording.
        """
        bounded: Any = _Bounded(self._stream, self._path.stat().st_size)
        found = iter(StreamReader(bounded, emit_chunks=True, record_size_limit=None).records)
        first = self._next(found)
        if not isinstance(first, Header) or first.profile != PROFILE:
            raise BadFileError(f"{self._path}: expected a recording, a file of `Recorder`")
        while (record := self._next(found)) is not None and not isinstance(record, DataEnd):
            if isinstance(record, Chunk):
                yield from (one for one in self._within(record) if names or isinstance(one, Message))
            elif isinstance(record, Schema | Channel):
                self._note([record])
                if names:
                    yield record
            elif isinstance(record, Metadata | Attachment):
                yield record

    def _next(self, found: Iterator[McapRecord]) -> McapRecord | None:
        try:
            return next(found)
        except StopIteration:
            return None
        except _TORN as error:
            self._torn(error)
            return None

    def _within(self, chunk: Chunk) -> list[McapRecord]:
        """Records of a chunk; none if its checksum says that it is damaged."""
        try:
            records = breakup_chunk(chunk, validate_crc=True)
        except _TORN as error:
            self._torn(error)
            return []
        self._note(records)
        return records

    def _note(self, records: list[McapRecord]) -> None:
        """Note the names of channels; the first ones count, because those within a chunk have a checksum."""
        self._topics = {record.id: record.topic for record in records if isinstance(record, Channel)} | self._topics

    def _torn(self, error: Exception) -> None:
        self.damage = self.damage or f"torn before byte {self._stream.tell()} ({type(error).__name__})"


@contextmanager
def opened(path: Path) -> Iterator[IO[bytes]]:
    """Open a recording for reading.

    Raises:
        ConfigError: it cannot be opened.
    """
    try:
        stream = path.open("rb")
    except OSError as error:
        raise ConfigError(f"recording {path}: {error.strerror}") from error
    with stream:
        yield stream


def _json_messages(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    with opened(path) as stream:
        scan = Scan(stream, path)
        for record in scan.records():
            if isinstance(record, Message):
                yield scan.topic(record), json.loads(record.data)


def _parsed(record: Metadata) -> dict[str, Any]:
    """Values of metadata; texts that are no JSON as they are."""
    return {name: _value(text) for name, text in record.metadata.items()}


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text
