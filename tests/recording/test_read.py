"""Reading: a file without an end is read up to where it is torn; what is no recording is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer
from recorded_drives import observations

from tral_env.errors import BadFileError, ConfigError
from tral_env.interface import CORE_LAYOUT
from tral_env.recording import topics
from tral_env.recording.file import RecordingFile
from tral_env.recording.mend import mend
from tral_env.recording.messages import Encoder, RecordedTick
from tral_env.recording.read import read
from tral_env.recording.recorder import ABOUT


@pytest.fixture(scope="module")
def chunks(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, list[int]]:
    """A file of ten ticks, each in a chunk of its own, and how long it is after each of them."""
    path = tmp_path_factory.mktemp("recording") / "drive.mcap"
    file, encoder, ends = RecordingFile(path), Encoder(CORE_LAYOUT, 0), []
    file.metadata(ABOUT, {"source": "car", "fields": list(CORE_LAYOUT.names), "configuration": {}})
    for k, row in enumerate(observations(10)):
        zero = np.zeros(2)
        head = (k, k / 80, k / 80, row.tobytes(), row.dtype, zero.tobytes(), zero.dtype)
        tick = RecordedTick(*head, None, None, 0, 0.0, "", None, (), None)
        for topic, data in encoder.messages(tick):
            file.message(topic, data, k, k)
        file.sync()
        ends.append(path.stat().st_size)
    file.finish()
    return path.read_bytes(), ends


@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_a_torn_file_gives_all_ticks_before_the_tear(
    chunks: tuple[bytes, list[int]], tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
):
    whole, ends = chunks
    cut = data.draw(st.integers(600, len(whole)), label="cut")
    tail = data.draw(st.sampled_from([b"", bytes(300), b"\x06" * 40, b"\xff" * 900]), label="tail")
    path = tmp_path_factory.mktemp("torn") / "torn.mcap"
    path.write_bytes(whole[:cut] + tail)
    found = read(path)
    assert len(found.tick) >= sum(end <= cut for end in ends)
    np.testing.assert_array_equal(found.observation, observations(10)[: len(found.tick)])
    assert bool(found.damage) or cut > ends[-1]


def test_a_damaged_chunk_does_not_hide_those_behind_it(chunks: tuple[bytes, list[int]], tmp_path: Path):
    whole, ends = chunks
    # The last bytes before the end of a chunk are its index, so the middle of it is content.
    middle = (ends[4] + ends[5]) // 2 - 100
    (tmp_path / "drive.mcap").write_bytes(whole[:middle] + bytes(8) + whole[middle + 8 :])
    found = read(tmp_path / "drive.mcap")
    assert found.tick.tolist() == [0, 1, 2, 3, 4, 6, 7, 8, 9]
    assert "torn" in found.damage


@pytest.mark.parametrize("share", [0.0, 0.5, 0.8])
def test_a_damaged_first_chunk_loses_itself_alone(chunks: tuple[bytes, list[int]], tmp_path: Path, share: float):
    whole, _ = chunks
    begin = whole.index(b"\x28\xb5\x2f\xfd")  # data of zstd begin so, and their length stands before them
    place = begin + round(share * int.from_bytes(whole[begin - 8 : begin], "little"))
    (tmp_path / "drive.mcap").write_bytes(whole[:place] + bytes(8) + whole[place + 8 :])
    found = read(tmp_path / "drive.mcap")
    assert found.tick.tolist() == list(range(1, 10))
    np.testing.assert_array_equal(found.observation, observations(10)[1:])
    assert "torn" in found.damage

    assert mend(tmp_path / "drive.mcap", tmp_path / "mended.mcap") == found.damage
    with (tmp_path / "mended.mcap").open("rb") as stream:
        told = [(schema.name, json.loads(message.data)) for schema, _, message in make_reader(stream).iter_messages()]
    assert [action["tick"] for name, action in told if name == "tral.Command"] == list(range(1, 10))


def test_names_behind_a_chunk_that_are_damaged_change_nothing(chunks: tuple[bytes, list[int]], tmp_path: Path):
    whole, _ = chunks
    assert whole.count(b"/action") == 2, "in plain text: behind the first chunk, and in the summary"
    (tmp_path / "drive.mcap").write_bytes(whole.replace(b"/action", b"/actino", 1))
    found = read(tmp_path / "drive.mcap")
    assert found.tick.tolist() == list(range(10))
    assert found.damage == ""


def test_a_file_that_is_no_mcap_is_refused(tmp_path: Path):
    (tmp_path / "a.mcap").write_bytes(b"no recording at all")
    with pytest.raises(BadFileError, match=r"a\.mcap: expected a recording"):
        read(tmp_path / "a.mcap")


def test_a_recording_of_something_else_is_refused(tmp_path: Path):
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        writer.finish()
    with pytest.raises(BadFileError, match="expected a recording"):
        read(tmp_path / "a.mcap")


def test_a_missing_file_is_told(tmp_path: Path):
    with pytest.raises(ConfigError, match="No such file"):
        read(tmp_path / "a.mcap")


def test_the_schemas_name_what_foxglove_knows():
    known = [topic.schema_name for topic in (topics.IMAGE, topics.POSE, topics.LOG)]
    assert known == ["foxglove.CompressedImage", "foxglove.PoseInFrame", "foxglove.Log"]
    assert topics.IMAGE.schema["required"] == ["timestamp", "frame_id", "data", "format"]
    assert topics.IMAGE.schema["properties"]["data"]["contentEncoding"] == "base64"


def test_what_is_no_recording_leaves_the_file_that_it_should_become(tmp_path: Path):
    (tmp_path / "junk.mcap").write_bytes(b"junk" * 100)
    (tmp_path / "older.mcap").write_bytes(b"older")
    with pytest.raises(BadFileError):
        mend(tmp_path / "junk.mcap", tmp_path / "older.mcap")
    assert (tmp_path / "older.mcap").read_bytes() == b"older"
    assert len(list(tmp_path.iterdir())) == 2
