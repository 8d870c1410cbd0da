"""`tral replay` without a terminal: what is asked of a recording becomes files and figures."""

from __future__ import annotations

import json
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tral_env.errors import BadFileError, ConfigError
from tral_env.interface import CORE_LAYOUT
from tral_env.recording.recorder import Recorder
from tral_fsm.programs.drive import DriveArguments
from tral_fsm.programs.drive import run as drive
from tral_fsm.programs.replay import SUMMARY, ReplayArguments, run

ARGUMENTS = DriveArguments(
    scenario="straight", seed=3, episodes=1, policy="wall", camera="projected", randomization="none", course=None,
    video=False, record=True,
)  # fmt: skip


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a recorded drive of two seconds."""
    folder = tmp_path_factory.mktemp("driven")
    course = folder / "short.json"
    course.write_text(json.dumps({"name": "short", "segments": [{"length": 3.0}]}))
    drive(replace(ARGUMENTS, course=str(course)), folder / "out", lambda name: nullcontext(lambda tick: None))
    return folder / "out"


def test_a_drive_lists_its_recording_and_the_next_one_replaces_it(driven: Path):
    (episode,) = json.loads((driven / "summary.json").read_text())["episodes"]
    assert episode["files"] == ["trajectory.png", "drive.mcap"]


def test_the_picture_and_the_figures_are_those_of_the_drive(driven: Path, tmp_path: Path):
    report = run(ReplayArguments(file=driven / "drive.mcap"), tmp_path)
    (episode,) = json.loads((driven / "summary.json").read_text())["episodes"]
    del episode["files"]
    assert report["episode"] == episode
    assert (tmp_path / "trajectory.png").read_bytes() == (driven / "trajectory.png").read_bytes()
    assert report == json.loads((tmp_path / SUMMARY).read_text())


def test_everything_that_is_asked_is_written(driven: Path, tmp_path: Path):
    ticks = []
    arguments = ReplayArguments(
        file=driven / "drive.mcap", against_simulation=True, policy="corridor", to=("csv", "mcap")
    )
    report = run(arguments, tmp_path, ticks.append)
    assert {path.name for path in tmp_path.iterdir()} == {
        "trajectory.png", "replay.json", "residuals.png", "residuals.csv", "policy.csv", "drive.csv", "drive.mcap",
    }  # fmt: skip
    assert ticks == list(range(report["ticks"]))
    assert report["against_simulation"]["residuals"]["speed"]["largest"] == 0.0
    assert not report["policy"]["drove"]
    lines = (tmp_path / "residuals.csv").read_text().splitlines()
    assert lines[0].startswith("time_s,recorded_ultrasonic_left,simulated_ultrasonic_left")
    assert len(lines) == report["ticks"] + 1


def test_a_video_of_a_simulated_drive_has_a_frame_every_fifth_tick(driven: Path, tmp_path: Path, opengl: None):
    report = run(ReplayArguments(file=driven / "drive.mcap", video=True), tmp_path)
    video = cv2.VideoCapture(str(tmp_path / "replay.mp4"))
    # The last picture is held for a second, of 16 frames.
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == -(-report["ticks"] // 5) + 16


def real(path: Path, images: bool) -> Path:
    """A recording as of a real car, which may have a camera."""
    row = CORE_LAYOUT.missing(1)[0].astype(np.float32)
    with Recorder(path) as recorder:
        for k in range(16):
            row[CORE_LAYOUT.column("distance")] = 0.01 * k
            recorder.tick(time_s=k / 80, observation=row, action=(0.5, 0.25), applied=(0.4, 0.25), state="rolling")
        if images:
            recorder.image(0.0, np.full((48, 64, 3), 200, np.uint8))
    return path


def test_a_real_drive_has_a_picture_by_dead_reckoning_and_no_episode(tmp_path: Path):
    report = run(ReplayArguments(file=real(tmp_path / "car.mcap", images=False), to=("csv",)), tmp_path / "out")
    assert report["episode"] is None
    assert report["distance_m"] == pytest.approx(0.15)
    assert report["states"] == {"rolling": 16}
    assert (tmp_path / "out/trajectory.png").stat().st_size > 10_000


def test_a_video_of_a_real_drive_shows_its_images(tmp_path: Path):
    run(ReplayArguments(file=real(tmp_path / "car.mcap", images=True), video=True), tmp_path / "out")
    found, frame = cv2.VideoCapture(str(tmp_path / "out/replay.mp4")).read()
    assert found
    assert frame[270, 480].min() > 150  # the middle of the picture is the image


def test_a_real_drive_without_images_has_no_video(tmp_path: Path):
    with pytest.raises(BadFileError, match="no video without images"):
        run(ReplayArguments(file=real(tmp_path / "car.mcap", images=False), video=True), tmp_path / "out")


def test_a_missing_recording_makes_no_folder(tmp_path: Path):
    with pytest.raises(ConfigError, match="No such file"):
        run(ReplayArguments(file=tmp_path / "none.mcap"), tmp_path / "out")
    assert not (tmp_path / "out").exists()
