"""A recorded drive as an MCAP file of ROS 2, as `ros2 bag`, Foxglove and PlotJuggler read it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import IO

from cyclonedds.idl import IdlStruct
from mcap.writer import Writer

from tral_env.atomic import whole_file
from tral_env.errors import ConfigError
from tral_env.recording.read import Recording
from tral_env.ros import topics
from tral_env.ros.definition import definition, ros_name
from tral_env.ros.description import robot_description, static_transforms
from tral_env.ros.msg.geometry import TFMessage
from tral_env.ros.msg.sensor import CompressedImage
from tral_env.ros.msg.std import Header, String
from tral_env.ros.odometry import DeadReckoning
from tral_env.ros.readings import ReadingMessages, Told
from tral_env.ros.times import seconds_ns, stamp


def write_bag(recording: Recording, path: Path) -> int:
    """Write a drive with the messages that the nodes would have sent.

    Args:
        recording: the drive.
        path: the new file; one that is there is replaced.

    Returns:
        Number of messages.

    Raises:
        ConfigError: the file cannot be written, or is the recording.
    """
    if path.resolve() == recording.path.resolve():
        raise ConfigError(f"{path}: is the recording itself: choose another file")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as stream:
            return _write(recording, stream)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}") from error


def _write(recording: Recording, stream: IO[bytes]) -> int:
    writer = Writer(stream)
    writer.start(profile="ros2", library="tral-env")
    channels: dict[str, int] = {}
    count = 0
    for time_ns, (topic, message) in _messages(recording):
        if topic not in channels:
            channels[topic] = _channel(writer, topic, type(message))
        data = message.serialize(use_version_2=False)
        writer.add_message(channels[topic], log_time=time_ns, publish_time=time_ns, data=data, sequence=count)
        count += 1
    writer.finish()
    return count


def _channel(writer: Writer, topic: str, kind: type[IdlStruct]) -> int:
    schema = writer.register_schema(ros_name(kind), "ros2msg", definition(kind).encode())
    return writer.register_channel(f"/{topic.lstrip('/')}", "cdr", schema)


def _messages(recording: Recording) -> Iterator[tuple[int, Told]]:
    """Time [ns] and message, in the order of time."""
    start_ns = seconds_ns(1.0)
    yield start_ns, Told(topics.TF_STATIC, TFMessage(static_transforms(start_ns)))
    yield start_ns, Told(topics.DESCRIPTION, String(robot_description()))
    told, reckoning, pictures = ReadingMessages(), DeadReckoning(), list(recording.pictures())
    for time_s, row in zip(recording.time_s.tolist(), recording.observation, strict=True):
        now_ns = start_ns + seconds_ns(time_s)
        while pictures and start_ns + seconds_ns(pictures[0].time_s) <= now_ns:
            picture = pictures.pop(0)
            exposed_ns = start_ns + seconds_ns(picture.time_s)
            header = Header(stamp(exposed_ns), topics.CAMERA_OPTICAL)
            yield now_ns, Told(topics.IMAGE, CompressedImage(header, "jpeg", picture.jpeg))
        readings = {name: float(value) for name, value in recording.layout.unpack(row).items()}
        for each in told.of(readings, now_ns):
            yield now_ns, each
        reckoning.update(*(readings[name] for name in ("distance", "speed", "steering", "throttle")))
        yield now_ns, Told(topics.TF, TFMessage([reckoning.transform(now_ns)]))
        yield now_ns, Told(topics.ODOMETRY, reckoning.message(now_ns))
