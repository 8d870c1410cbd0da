"""An MCAP file that grows by small chunks, each on the disk before the next begins."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Schema
from mcap.writer import CompressionType, Writer

from tral_env.errors import ConfigError
from tral_env.recording.topics import Topic

PROFILE = "tral"
"""The header of a recording says so."""
_CHUNK_BYTES = 16 << 20
"""A chunk ends at this size even between two flushes; only many large images reach it."""


class _Stream:
    """A file whose writes are whole, or raise an error."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor, self._length = descriptor, 0

    def write(self, data: bytes) -> int:
        """Write all bytes."""
        rest = memoryview(data)
        while rest:
            done = os.write(self._descriptor, rest)
            self._length += done
            rest = rest[done:]
        return len(data)

    def tell(self) -> int:
        """Number of bytes so far."""
        return self._length

    def flush(self) -> None:
        """Do nothing: `write` keeps nothing back."""


class RecordingFile:
    """The writer's end of a recording."""

    def __init__(self, path: Path) -> None:
        """Make the file; a file that exists is never replaced.

        Raises:
            ConfigError: the file exists, or cannot be made.
        """
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        except OSError as error:
            raise ConfigError(
                f"recording {path}: {error.strerror}: choose another file; none is overwritten"
            ) from error
        _sync_folder(path.parent)
        self._stream = _Stream(self._descriptor)
        self._writer = Writer(self._stream, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        self._channels: dict[str, int] = {}
        self._names = RecordBuilder()
        """Schemas and channels that stand in the growing chunk alone."""
        self._whole = 0
        """Everything before this byte is readable."""
        self._writer.start(profile=PROFILE, library="tral-env")

    def metadata(self, name: str, values: Mapping[str, object]) -> None:
        """Write named texts; what is no text is written as JSON."""
        texts = {key: value if isinstance(value, str) else json.dumps(value) for key, value in values.items()}
        self._writer.add_metadata(name, texts)

    def attach(self, name: str, data: bytes, media_type: str, stamp_ns: int) -> None:
        """Write a file into the file."""
        self._writer.add_attachment(stamp_ns, stamp_ns, name, media_type, data)

    def message(self, topic: Topic, data: bytes, log_ns: int, publish_ns: int) -> None:
        """Add a message to the chunk that grows."""
        channel = self._channels.get(topic.name)
        if channel is None:
            channel = self._channels[topic.name] = self._register(topic)
        self._writer.add_message(channel, log_ns, data, publish_ns)

    def sync(self) -> None:
        """End the chunk, and wait until it is on the disk.

        Raises:
            OSError: the disk does not take it.
        """
        self._end_chunk()
        os.fsync(self._descriptor)
        self._whole = self._stream.tell()

    def finish(self) -> None:
        """Write the index, and close the file.

        Raises:
            OSError: the disk does not take it.
        """
        self._end_chunk()
        self._writer.finish()
        os.fsync(self._descriptor)
        os.close(self._descriptor)

    def abandon(self) -> None:
        """Cut off what the disk did not take whole, and close the file without an index."""
        try:
            os.ftruncate(self._descriptor, self._whole)
        finally:
            os.close(self._descriptor)

    def _register(self, topic: Topic) -> int:
        """Write schema and channel of a topic into the chunk, and note them for `_end_chunk`."""
        name, encoding, text = topic.schema_name, "jsonschema", topic.schema_text
        schema = self._writer.register_schema(name, encoding, text)
        channel = self._writer.register_channel(topic.name, "json", schema)
        Schema(id=schema, name=name, encoding=encoding, data=text).write(self._names)
        Channel(id=channel, topic=topic.name, message_encoding="json", schema_id=schema, metadata={}).write(self._names)
        return channel

    def _end_chunk(self) -> None:
        """End the chunk, and repeat behind it the schemas and channels that it names.

        So whoever finds the chunk damaged still knows what the later ones hold.
        """
        self._writer.flush()
        if self._names.count:
            self._stream.write(self._names.end())


def _sync_folder(folder: Path) -> None:
    """Bring the name of a new file onto the disk, where the system can."""
    if os.name == "posix":
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def free_path(path: Path) -> Path:
    """The path itself if there is no such file, else the first free one of `drive-2.mcap`, `drive-3.mcap`, ..."""
    candidate, number = path, 1
    while candidate.exists():
        number += 1
        candidate = path.with_name(f"{path.stem}-{number}{path.suffix}")
    return candidate
