"""Videos are H.264 in mp4 files."""

from __future__ import annotations

import errno
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from films import film

from tral_env.errors import RenderError
from tral_env.recording.video import VideoWriter, encoder


def picture(level: int, height: int = 48, width: int = 64) -> np.ndarray:
    """Grey with a red left half."""
    image = np.full((height, width, 3), level, np.uint8)
    image[:, : width // 2] = 220, 30, 30
    return image


def test_a_video_has_the_pictures_in_their_order_and_colours(tmp_path: Path) -> None:
    levels = [20, 90, 160, 230]
    with VideoWriter(tmp_path / "a.mp4", fps=10, quality=18) as video:
        for level in levels:
            video.add(picture(level))
    made = film(tmp_path / "a.mp4")
    assert made.fps == 10
    assert [pytest.approx(level, abs=6) for level in levels] == [each[24, 50, 1] for each in made.pictures]
    assert np.abs(made.pictures[0][24, 10].astype(int) - (220, 30, 30)).max() < 12


def test_a_size_that_is_odd_grows_by_a_pixel(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "a.mp4", fps=10, quality=18) as video:
        video.add(picture(90, height=47, width=63))
    assert film(tmp_path / "a.mp4").pictures[0].shape == (48, 64, 3)


def test_without_a_picture_there_is_no_file(tmp_path: Path) -> None:
    VideoWriter(tmp_path / "a.mp4", fps=10, quality=24).close()
    assert not (tmp_path / "a.mp4").exists()


def test_a_folder_that_is_not_there_is_an_error_of_the_file(tmp_path: Path) -> None:
    video = VideoWriter(tmp_path / "none" / "a.mp4", fps=10, quality=24)
    with pytest.raises(OSError, match="No such file"), video:
        video.add(picture(0))


@pytest.fixture
def full_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(video: VideoWriter, frame: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(VideoWriter, "_encode", full)


@pytest.mark.usefixtures("full_disk")
def test_a_full_disk_is_told_once_and_leaves_no_thread(tmp_path: Path) -> None:
    video = VideoWriter(tmp_path / "a.mp4", fps=10, quality=24)
    video.add(picture(0))
    video.add(picture(0))
    with pytest.raises(OSError, match="No space left"):
        video.close()
    video.close()
    assert not [each for each in threading.enumerate() if each.name.startswith("encoder")]


@pytest.mark.usefixtures("full_disk")
def test_a_full_disk_is_told_after_four_pictures(tmp_path: Path) -> None:
    video = VideoWriter(tmp_path / "a.mp4", fps=10, quality=24)
    for _ in range(4):
        video.add(picture(0))
    with pytest.raises(OSError, match="No space left"):
        video.add(picture(0))
    with pytest.raises(OSError, match="No space left"):
        video.close()


def test_the_encoder_is_told_and_its_absence_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    assert encoder().startswith("libx264")
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(RenderError, match=r"no encoder .*: pip install .* --no-video"):
        encoder()
