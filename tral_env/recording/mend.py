"""A recording that was torn, as a whole file: other programs want the index at its end."""

from __future__ import annotations

from pathlib import Path

from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.writer import Writer

from tral_env.atomic import whole_file
from tral_env.errors import ConfigError
from tral_env.recording.file import PROFILE
from tral_env.recording.read import Scan, opened


def mend(path: Path, out: Path) -> str:
    """Copy what is whole of a recording into a new file, and give that an index.

    Args:
        path: the recording.
        out: the new file, which is replaced if it exists.

    Returns:
        Where and why the recording was torn; empty: it was not.

    Raises:
        ConfigError: the two are the same file, or the recording cannot be opened.
        BadFileError: it is no recording; a file that was there stays.
    """
    if out.exists() and out.samefile(path):
        raise ConfigError(f"{out} is the recording itself: choose another folder")
    with opened(path) as stream, whole_file(out) as copy:
        writer, scan = Writer(copy), Scan(stream, path)
        writer.start(profile=PROFILE, library="tral-env")
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        for record in scan.records(names=True):
            if isinstance(record, Schema) and record.id not in schemas:
                schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            elif isinstance(record, Channel) and record.id not in channels:
                channels[record.id] = writer.register_channel(
                    record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
                )
            elif isinstance(record, Metadata):
                writer.add_metadata(record.name, record.metadata)
            elif isinstance(record, Attachment):
                writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)
            elif isinstance(record, Message) and record.channel_id in channels:
                writer.add_message(
                    channels[record.channel_id], record.log_time, record.data, record.publish_time, record.sequence
                )
        writer.finish()
    return scan.damage
