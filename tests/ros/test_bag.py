"""A recorded drive with the schemas of ROS 2, in readers that are not ours."""

from __future__ import annotations

import errno
import math
import os
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from message_types import official

from tral_env.errors import ConfigError
from tral_env.recording.read import read
from tral_env.ros.bag import write_bag

DRIVE = Path(__file__).parents[2] / "docs/recordings/short.mcap"


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bag") / "drive.mcap"
    assert write_bag(read(DRIVE), path) > 1000
    return path


def test_mcap_ros2_reads_what_was_driven(bag: Path) -> None:
    drive = read(DRIVE)
    with bag.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        found: dict[str, list[object]] = {}
        for _, channel, _, message in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append(message)
    ways = [message.position[2] * 0.032 for message in found["/joint_states"]]  # type: ignore[attr-defined]
    np.testing.assert_allclose(ways, drive.layout.unpack(drive.observation)["distance"], atol=1e-4)
    lefts = {message.range for message in found["/ultrasonic/left"]}  # type: ignore[attr-defined]
    told = set(drive.layout.unpack(drive.observation)["ultrasonic_left"].tolist())
    assert {6.0 if math.isinf(metres) else metres for metres in lefts} <= told
    assert len(found["/odom"]) == len(drive.tick)


def test_rosbags_reads_every_message(bag: Path) -> None:
    store = official()
    with bag.open("rb") as stream:
        for schema, _, message in make_reader(stream).iter_messages():
            assert schema is not None
            store.deserialize_cdr(message.data, schema.name)


def test_a_recording_is_not_replaced_by_its_own_bag(tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    path.write_bytes(DRIVE.read_bytes())
    with pytest.raises(ConfigError, match="is the recording itself"):
        write_bag(read(path), tmp_path / "." / "drive.mcap")
    assert path.read_bytes() == DRIVE.read_bytes()


def test_a_disk_that_fills_up_is_told_and_the_old_file_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "old.mcap"
    path.write_bytes(b"old")
    monkeypatch.setattr("tral_env.ros.bag._channel", full)
    with pytest.raises(ConfigError, match=r"old\.mcap: cannot be written: No space left on device"):
        write_bag(read(DRIVE), path)
    assert [each.read_bytes() for each in tmp_path.iterdir()] == [b"old"]
