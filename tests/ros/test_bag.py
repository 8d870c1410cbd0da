"""A recorded drive with the schemas of ROS 2, in readers that are not ours."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from message_types import official

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
