"""A recorder: what it is told is in the file, bit by bit; it never waits, and no disk stops a drive."""

from __future__ import annotations

import errno
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from recorded_drives import observations, record

from tral_env.errors import ConfigError
from tral_env.recording import recorder as recorder_module
from tral_env.recording.file import RecordingFile, free_path
from tral_env.recording.messages import jpeg
from tral_env.recording.read import read
from tral_env.recording.recorder import Recorder
from tral_fsm.runtime.machine import Transit


def test_a_recording_gives_back_observations_and_actions_bit_by_bit(tmp_path: Path):
    rows = record(tmp_path / "drive.mcap", 50)
    found = read(tmp_path / "drive.mcap")
    assert not found.damage
    assert found.observation.dtype == np.float32
    np.testing.assert_array_equal(found.observation, rows)
    np.testing.assert_array_equal(found.action, np.tile([0.1, -1 / 3], (50, 1)))
    np.testing.assert_array_equal(found.tick, np.arange(50))
    np.testing.assert_array_equal(found.time_s, np.arange(50) / 80)


def test_a_recording_tells_what_the_car_and_the_policy_did(tmp_path: Path):
    fired = Transit(time=0.5, path=(3,), source=1, target="b", transition="go", why="front 0.4 < 0.5")
    record(
        tmp_path / "drive.mcap",
        2,
        applied=(0.05, 0.25),
        pulses_us=(1510.5, 1600.0),
        late_ticks=3,
        lateness_s=0.002,
        state="Gate/Approach",
        wanted=(1.0, float("nan")),
        transitions=(fired,),
    )
    found = read(tmp_path / "drive.mcap")
    assert found.applied[1].tolist() == [0.05, 0.25]
    assert found.pulses_us[1].tolist() == [1510.5, 1600.0]
    assert found.late_ticks.tolist() == [3, 3]
    assert found.lateness_s.tolist() == [0.002, 0.002]
    assert found.states == ("Gate/Approach", "Gate/Approach")
    np.testing.assert_array_equal(found.wanted[0], [1.0, np.nan])
    assert found.transitions[1] == (1, 0.5, (3,), 1, "b", "go", "front 0.4 < 0.5")


def test_what_was_not_told_is_missing(tmp_path: Path):
    record(tmp_path / "drive.mcap", 1)
    found = read(tmp_path / "drive.mcap")
    assert np.isnan(found.applied).all()
    assert np.isnan(found.pulses_us).all()
    assert found.states == ("",)
    assert found.truth == ({},)
    assert found.source == "car"


def test_ground_truth_has_topics_of_its_own(tmp_path: Path):
    truth = {"pose": np.array([1.0, 2.0, 0.5]), "speed_mps": np.float64(0.1), "success": False, "clearance": np.nan}
    record(tmp_path / "drive.mcap", 1, truth=truth)
    told = read(tmp_path / "drive.mcap").truth[0]
    assert {name: told[name] for name in told if name not in ("tick", "time_s")} == {
        "x_m": 1.0,
        "y_m": 2.0,
        "yaw_rad": 0.5,
        "speed_mps": 0.1,
        "success": False,
    }


def test_configuration_and_files_stand_in_the_file(tmp_path: Path):
    with Recorder(tmp_path / "a.mcap", configuration={"seed": 7, "car": {"friction": 0.5}}, files={"m.json": b"{}"}):
        pass
    found = read(tmp_path / "a.mcap")
    assert found.configuration == {"seed": 7, "car": {"friction": 0.5}}
    assert found.files == {"m.json": b"{}"}
    assert found.about["versions"]["tral-env"]


def test_images_are_jpeg_with_the_time_of_their_exposure(tmp_path: Path):
    pixels = np.zeros((48, 64, 3), np.uint8)
    pixels[:, :32, 0] = 255
    with Recorder(tmp_path / "a.mcap", start_s=10.0) as recorder:
        recorder.image(10.5, pixels)
        recorder.image(10.6, jpeg(pixels), "second")
    first, second = read(tmp_path / "a.mcap").pictures()
    assert (first.time_s, first.camera) == (0.5, "camera")
    assert (second.time_s, second.camera) == (pytest.approx(0.6), "second")
    assert first.jpeg == second.jpeg == jpeg(pixels)


def test_bytes_of_sensors_and_words_are_kept(tmp_path: Path):
    with Recorder(tmp_path / "a.mcap") as recorder:
        recorder.frame(0.25, "left ultrasonic", b"\x00\xff")
        recorder.say(0.5, "armed again", "warning")
    found = read(tmp_path / "a.mcap")
    assert found.frames == ((0.25, "left ultrasonic", b"\x00\xff"),)
    assert found.words == ("the recording begins", "armed again")


def test_the_reader_of_the_mcap_library_opens_a_finished_file(tmp_path: Path):
    record(tmp_path / "drive.mcap", 3, state="Follow", truth={"pose": (0.0, 0.0, 0.0)})
    with (tmp_path / "drive.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        topics = {channel.topic: summary.schemas[channel.schema_id].name for channel in summary.channels.values()}
        stamps = [message.log_time for _, _, message in reader.iter_messages("/action")]
    assert topics == {
        "/action": "tral.Command",
        "/log": "foxglove.Log",
        "/loop": "tral.Loop",
        "/observation": "tral.Observation",
        "/state": "tral.State",
        "/truth": "tral.Truth",
        "/truth/pose": "foxglove.PoseInFrame",
    }
    assert np.diff(stamps).tolist() == [12_500_000, 12_500_000]


def test_a_file_is_never_overwritten(tmp_path: Path):
    path = tmp_path / "drive.mcap"
    record(path)
    before = path.read_bytes()
    with pytest.raises(ConfigError, match="File exists"):
        Recorder(path)
    assert path.read_bytes() == before
    assert free_path(path) == tmp_path / "drive-2.mcap"
    assert free_path(tmp_path / "new.mcap") == tmp_path / "new.mcap"


def test_an_unknown_source_is_refused(tmp_path: Path):
    with pytest.raises(ConfigError, match="simulation"):
        Recorder(tmp_path / "a.mcap", source="simulator")


class _SlowDisk(RecordingFile):
    """A disk that takes nothing before it is told to."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.go_on, self.asked = threading.Event(), threading.Event()

    def message(self, *args: Any) -> None:
        self.asked.set()
        assert self.go_on.wait(30.0)
        super().message(*args)


def test_a_slow_disk_never_holds_up_the_drive_and_what_is_dropped_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    monkeypatch.setattr(recorder_module, "MAX_WAITING", 10)
    disks: list[_SlowDisk] = []

    def opened(path: Path) -> RecordingFile:
        disks.append(_SlowDisk(path))
        return disks[0]

    row = observations(1)[0]
    with Recorder(tmp_path / "drive.mcap", open_file=opened) as recorder:
        assert disks[0].asked.wait(30.0)  # the first word is taken, the queue is empty
        for k in range(25):
            recorder.tick(time_s=k / 80, observation=row, action=(0.0, 0.0))
        assert recorder.dropped == 15
        disks[0].go_on.set()
    assert "15 messages were dropped" in caplog.text
    found = read(tmp_path / "drive.mcap")
    assert found.tick.tolist() == list(range(10))


class _FullDisk(RecordingFile):
    """A disk that is full after some ticks."""

    def message(self, topic: Any, data: bytes, log_ns: int, publish_ns: int) -> None:
        if topic.name == "/action" and b'"tick": 3,' in data:
            self.sync()
            raise OSError(errno.ENOSPC, "No space left on device")
        super().message(topic, data, log_ns, publish_ns)


def test_a_full_disk_ends_the_recording_with_a_word_and_not_the_drive(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    row = observations(1)[0]
    with Recorder(tmp_path / "drive.mcap", open_file=_FullDisk) as recorder:
        for k in range(10):
            recorder.tick(time_s=k / 80, observation=row, action=(0.0, 0.0))
    assert "No space left on device: the recording ended" in recorder.failure
    assert recorder.failure in caplog.text
    recorder.tick(time_s=1.0, observation=row, action=(0.0, 0.0))
    assert read(tmp_path / "drive.mcap").tick.tolist() == [0, 1, 2]


def test_what_no_message_can_be_made_of_is_refused_and_the_rest_recorded(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    row = observations(1)[0]
    with Recorder(tmp_path / "drive.mcap") as recorder:
        recorder.image(0.0, np.zeros((3, 4, 5), np.uint8))
        recorder.tick(time_s=0.0, observation=row, action=(0.0, 0.0), lateness_s=float("nan"))
        recorder.tick(time_s=0.1, observation=row, action=(0.0, 0.0))
    assert recorder.refused == 2
    assert "cannot be recorded" in caplog.text
    assert not recorder.failure
    assert read(tmp_path / "drive.mcap").tick.tolist() == [1]


class _FullFromTheStart(RecordingFile):
    """A disk that takes nothing."""

    def metadata(self, name: str, values: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_disk_that_is_full_from_the_start_is_told_before_the_drive(tmp_path: Path):
    with pytest.raises(ConfigError, match="No space left on device"):
        Recorder(tmp_path / "drive.mcap", open_file=_FullFromTheStart)


def test_readings_and_answers_that_are_no_numbers_are_recorded_as_such(tmp_path: Path):
    rows = observations(3)
    rows[1, 0], rows[2, 1] = np.nan, np.inf
    with Recorder(tmp_path / "drive.mcap") as recorder:
        for k, row in enumerate(rows):
            recorder.tick(time_s=k / 80, observation=row, action=(float("nan") if k == 1 else 0.1, 0.2))
    found = read(tmp_path / "drive.mcap")
    rows[2, 1] = np.nan  # JSON has neither of them
    np.testing.assert_array_equal(found.observation, rows)
    np.testing.assert_array_equal(found.action, [[0.1, 0.2], [np.nan, 0.2], [0.1, 0.2]])


def test_a_time_that_no_clock_can_tell_is_refused_and_the_rest_recorded(tmp_path: Path):
    row = observations(1)[0]
    with Recorder(tmp_path / "drive.mcap") as recorder:
        recorder.tick(time_s=1e300, observation=row, action=(0.0, 0.0))
        recorder.tick(time_s=0.1, observation=row, action=(0.0, 0.0))
    assert recorder.refused == 1
    assert read(tmp_path / "drive.mcap").tick.tolist() == [1]


class _Broken(RecordingFile):
    """A writer that fails as no disk does."""

    def message(self, *_: Any) -> None:
        raise RuntimeError("the writer is broken")


def test_a_writer_that_fails_in_its_own_way_is_told_and_does_not_stop_the_drive(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    recorder = Recorder(tmp_path / "drive.mcap", open_file=_Broken)
    recorder.tick(time_s=0.0, observation=observations(1)[0], action=(0.0, 0.0))
    recorder.close()
    assert "the writer is broken" in recorder.failure
    assert "the recording ended after" in recorder.failure
    assert recorder.failure in caplog.text


def test_a_configuration_that_json_does_not_have_is_refused(tmp_path: Path):
    with pytest.raises(ConfigError, match="the configuration is nothing that JSON has"):
        Recorder(tmp_path / "drive.mcap", configuration={"car": object()})
