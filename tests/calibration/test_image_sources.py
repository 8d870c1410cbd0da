"""Images from files, folders, patterns and videos."""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from tral_env.calibration.image_sources import find_sources, read_images
from tral_env.errors import ConfigError, HardwareError


def grey(level: int):
    return np.full((48, 64, 3), level, np.uint8)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, level in (("b.png", 20), ("a.PNG", 10), ("c.bmp", 30)):
        cv2.imwrite(str(tmp_path / name), grey(level))
    (tmp_path / "notes.txt").write_text("not an image")
    video = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10, (64, 48))
    for level in range(0, 200, 20):
        video.write(grey(level))
    video.release()
    return tmp_path


def test_a_folder_gives_its_images_by_name(folder: Path):
    assert [Path(name).name for name in find_sources([str(folder)])] == ["a.PNG", "b.png", "c.bmp", "v.avi"]


def test_a_pattern_gives_what_fits_it(folder: Path):
    assert [Path(name).name for name in find_sources([f"{folder}/*.[pb][nm][gp]"])] == ["b.png", "c.bmp"]


def test_images_come_in_the_order_named(folder: Path):
    sources = find_sources([str(folder / "c.bmp"), str(folder / "a.PNG")])
    assert [(Path(name).name, int(image.mean())) for name, image in read_images(sources)] == [
        ("c.bmp", 30),
        ("a.PNG", 10),
    ]


def test_a_video_gives_one_in_so_many_frames(folder: Path):
    seen = [
        (name.rsplit(":", 1)[1], float(image.mean())) for name, image in read_images([str(folder / "v.avi")], every=4)
    ]
    assert [name for name, _ in seen] == ["0", "4", "8"]
    assert [level for _, level in seen] == pytest.approx([0, 80, 160], abs=3)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("none.png", "no such file or folder, and no pattern that fits"),
        ("*.jpg", "no such file or folder, and no pattern that fits"),
        ("notes.txt", "neither image nor video. Allowed: .png"),
        ("empty", "no image or video in this folder"),
    ],
)
def test_what_cannot_be_looked_at_is_refused(folder: Path, source: str, message: str):
    (folder / "empty").mkdir()
    with pytest.raises(ConfigError, match=message):
        find_sources([str(folder / source)])


@pytest.mark.parametrize("name", ["x.png", "x.mp4"])
@pytest.mark.parametrize("content", [b"", b"broken"])
def test_a_broken_file_is_named_without_an_image_and_the_next_one_is_read(folder: Path, name: str, content: bytes):
    (folder / name).write_bytes(content)
    seen = list(read_images([str(folder / name), str(folder / "a.PNG")]))
    assert seen[0] == (str(folder / name), None)
    assert seen[1][1].shape == (48, 64, 3)


def test_an_image_that_claims_to_be_larger_than_any_is_broken(tmp_path: Path):
    size = struct.pack(">4sIIBBBBB", b"IHDR", 2**22, 2**22, 8, 2, 0, 0, 0)
    header = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + size + struct.pack(">I", zlib.crc32(size))
    (tmp_path / "x.png").write_bytes(header)
    assert list(read_images([str(tmp_path / "x.png")])) == [(str(tmp_path / "x.png"), None)]


def test_a_camera_that_is_not_there_is_a_fault_of_the_hardware():
    assert find_sources(["/dev/video97"]) == ["/dev/video97"]
    with pytest.raises(HardwareError, match="no camera, or another program uses it"):
        next(read_images(["/dev/video97"]))


def test_the_number_of_a_camera_is_told_its_device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match="no pattern that fits a file; camera 0 is /dev/video0"):
        find_sources(["0"])
