"""Recordings in other formats: CSV, LeRobotDataset v3, and a torn file mended. Each is opened by a reader of others."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from recorded_drives import observations, record

from tral_env.errors import ConfigError
from tral_env.interface import CORE_LAYOUT
from tral_env.recording.mend import mend
from tral_env.recording.read import read
from tral_env.recording.recorder import Recorder
from tral_env.recording.table import write_csv

RED, BLUE = (np.full((48, 64, 3), colour, np.uint8) for colour in ((255, 0, 0), (0, 0, 255)))


def with_images(path: Path, ticks: int = 16) -> np.ndarray:
    """Record a drive whose camera sees red, and blue from tick 8 on."""
    rows = observations(ticks)
    with Recorder(path, configuration={"scenario": "gates"}) as recorder:
        recorder.image(0.0, RED)
        recorder.image(8 / 80, BLUE)
        for k, row in enumerate(rows):
            recorder.tick(time_s=(k + 1) / 80, observation=row, action=(0.1 * k, 0.5), state="Follow")
    return rows


def test_a_table_has_a_row_for_each_tick_and_empty_cells_for_what_is_missing(tmp_path: Path):
    rows = record(tmp_path / "a.mcap", 3, state="Follow", wanted=(1.0, float("nan")), truth={"pose": (1.0, 2.0, 0.5)})
    write_csv(read(tmp_path / "a.mcap"), tmp_path / "a.csv")
    with (tmp_path / "a.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [row["tick"] for row in table] == ["0", "1", "2"]
    assert np.float32(table[2]["ultrasonic_left"]) == rows[2, CORE_LAYOUT.column("ultrasonic_left")]
    assert (table[0]["state"], table[0]["wanted_side"], table[0]["wanted_clearance_m"]) == ("Follow", "1", "")
    assert (table[0]["applied_steering"], table[0]["steering_us"], table[0]["true_x_m"]) == ("", "", "1")


def test_a_mended_file_opens_in_the_reader_of_the_library(tmp_path: Path):
    with_images(tmp_path / "whole.mcap", 200)
    data = (tmp_path / "whole.mcap").read_bytes()
    (tmp_path / "torn.mcap").write_bytes(data[: len(data) - 200])
    damage = mend(tmp_path / "torn.mcap", tmp_path / "mended.mcap")
    assert damage == read(tmp_path / "torn.mcap").damage
    with (tmp_path / "mended.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        actions = sum(1 for _ in reader.iter_messages("/action"))
        summary = reader.get_summary()
    assert summary is not None
    assert actions == len(read(tmp_path / "torn.mcap").tick) == len(read(tmp_path / "mended.mcap").tick)
    assert read(tmp_path / "mended.mcap").configuration == {"scenario": "gates"}
    assert not read(tmp_path / "mended.mcap").damage


def test_a_recording_is_not_mended_onto_itself(tmp_path: Path):
    record(tmp_path / "a.mcap")
    with pytest.raises(ConfigError, match="is the recording itself"):
        mend(tmp_path / "a.mcap", tmp_path / "a.mcap")


class TestLeRobot:
    """Source of the format: huggingface/lerobot, codebase version v3.0."""

    @pytest.fixture
    def dataset(self, tmp_path: Path) -> Path:
        lerobot = pytest.importorskip("tral_env.recording.lerobot")
        pytest.importorskip("pyarrow")
        for name in ("a", "b"):
            with_images(tmp_path / f"{name}.mcap")
        recordings = [read(tmp_path / f"{name}.mcap") for name in ("a", "b")]
        lerobot.write_dataset(recordings, tmp_path / "set")
        return tmp_path / "set"

    def test_the_frames_are_the_ticks_bit_by_bit(self, dataset: Path):
        parquet = pytest.importorskip("pyarrow.parquet")
        rows = observations(16)
        for episode in (0, 1):
            table = parquet.read_table(dataset / f"data/chunk-000/file-{episode:03d}.parquet").to_pydict()
            np.testing.assert_array_equal(np.array(table["observation.state"], np.float32), rows)
            np.testing.assert_array_equal(np.array(table["action"], np.float32)[:, 0], np.float32(0.1 * np.arange(16)))
            np.testing.assert_array_equal(np.array(table["timestamp"], np.float32), np.float32(np.arange(16) / 80))
            assert table["index"] == list(range(16 * episode, 16 * episode + 16))
            assert set(table["episode_index"]) == {episode}

    def test_the_video_has_a_frame_for_each_tick_with_the_last_image_before_it(self, dataset: Path):
        path = dataset / "videos/observation.images.camera/chunk-000/file-001.mp4"
        video = cv2.VideoCapture(str(path))
        assert video.get(cv2.CAP_PROP_FPS) == 80.0
        frames = []
        while (found := video.read())[0]:
            frames.append(found[1])
        assert len(frames) == 16
        # The policy is asked at the beginning of its tick: in tick 8 it can know the image of that moment.
        reds = [frame[..., 2].mean() > 128 for frame in frames]
        assert reds == [True] * 8 + [False] * 8

    def test_the_metadata_tell_the_features_and_where_each_episode_lies(self, dataset: Path):
        parquet = pytest.importorskip("pyarrow.parquet")
        info = json.loads((dataset / "meta/info.json").read_text())
        assert info["codebase_version"] == "v3.0"
        assert (info["total_episodes"], info["total_frames"], info["fps"]) == (2, 32, 80)
        assert info["features"]["observation.state"]["names"] == list(CORE_LAYOUT.names)
        assert info["features"]["observation.images.camera"]["shape"] == [48, 64, 3]
        episodes = parquet.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
        told = [(row["episode_index"], row["dataset_from_index"], row["dataset_to_index"]) for row in episodes]
        assert told == [(0, 0, 16), (1, 16, 32)]
        assert episodes[1]["videos/observation.images.camera/to_timestamp"] == 0.2
        tasks = parquet.read_table(dataset / "meta/tasks.parquet").to_pydict()
        assert tasks == {"task_index": [0], "task": ["drive through the corridor: gates"]}

    def test_the_statistics_are_those_of_all_frames(self, dataset: Path):
        stats = json.loads((dataset / "meta/stats.json").read_text())
        both = np.concatenate([observations(16), observations(16)]).astype(float)
        np.testing.assert_allclose(stats["observation.state"]["mean"], both.mean(0))
        np.testing.assert_allclose(stats["observation.state"]["std"], both.std(0))
        assert stats["observation.state"]["count"] == [32]
        assert np.shape(stats["observation.images.camera"]["mean"]) == (3, 1, 1)

    def test_a_folder_that_holds_something_is_refused(self, dataset: Path, tmp_path: Path):
        lerobot = pytest.importorskip("tral_env.recording.lerobot")
        with pytest.raises(ConfigError, match="not empty"):
            lerobot.write_dataset([read(tmp_path / "a.mcap")], dataset)

    def test_recordings_with_and_without_images_do_not_fit_together(self, dataset: Path, tmp_path: Path):
        lerobot = pytest.importorskip("tral_env.recording.lerobot")
        record(tmp_path / "bare.mcap")
        with pytest.raises(ConfigError, match=r"bare\.mcap has other readings, or other images"):
            lerobot.write_dataset([read(tmp_path / f"{name}.mcap") for name in ("a", "bare")], tmp_path / "other")
