"""`tral detect` on images and videos."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from photo import photograph
from typer.testing import CliRunner, Result

from tral_env.config import CameraConfig
from tral_env.perception.sight import Sight, look
from tral_fsm.cli import app
from tral_fsm.report.sight import annotated

GATE = [(8, 3.0, 0.6), (9, 3.0, -0.4)]


def tral(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["detect", *(str(argument) for argument in arguments)])


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    cv2.imwrite(str(tmp_path / "photo.png"), photograph(GATE))
    return tmp_path / "photo.png"


def test_markers_and_gates_are_told(photo: Path) -> None:
    result = tral(photo)
    assert result.exit_code == 0
    assert result.stdout.splitlines() == [
        f"{photo}:",
        "  marker 8: gate 4, left",
        "  marker 9: gate 4, right",
        "  gate 4: both markers are seen",
    ]


def test_with_a_lens_their_places_are_told(photo: Path) -> None:
    lines = tral(photo, "--lens", "default").stdout.splitlines()
    assert lines[1].startswith("  marker 8: gate 4, left: 3.0")
    assert lines[1].endswith("deg left")
    assert lines[3].endswith("1.9 deg left; direction through it: 0 deg")


def test_json_is_a_line_for_each_image(photo: Path) -> None:
    lines = tral(photo, photo, "--lens", "default", "--json").stdout.splitlines()
    records = [json.loads(line) for line in lines]
    assert [record["image"] for record in records] == [str(photo)] * 2
    assert [marker["id"] for marker in records[0]["markers"]] == [8, 9]
    assert records[0]["gates"][0]["distance_m"] == pytest.approx(3.0, rel=0.02)


def test_without_any_marker_it_ends_with_1_and_says_what_fits(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "other.png"), photograph([(1, 1.5, 0.0)], name="DICT_6X6_50"))
    result = tral(tmp_path / "other.png")
    assert result.exit_code == 1
    assert "! no marker of DICT_4X4_50, but 1 marker of DICT_6X6_50" in result.stdout


def test_a_damaged_image_is_told_and_the_others_are_looked_at(photo: Path, tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(photo.read_bytes()[:20])
    result = tral(tmp_path)
    assert result.exit_code == 0
    assert "! damaged, empty or not to be opened" in result.stdout
    assert "marker 8" in result.stdout


def test_a_picture_shows_what_is_seen(photo: Path, tmp_path: Path) -> None:
    for _ in range(2):
        assert tral(photo, photo, "--out", tmp_path / "out" / "seen.PNG").exit_code == 0
    before, after = cv2.imread(str(photo)), cv2.imread(str(tmp_path / "out" / "seen.PNG"))
    assert before is not None
    assert after is not None
    assert after.shape == before.shape
    marker = look(before).markers[0]
    top = np.rint(marker.corners[:2].mean(axis=0)).astype(int)
    assert after[top[1], top[0]].tolist() == [90, 220, 90]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["seen.PNG", "seen_2.PNG"]


@pytest.mark.parametrize("markers", [[], GATE, GATE[::-1], [(9, 3.0, 0.6), (8, 3.0, -0.4), (40, 4.0, 0.1)]])
@pytest.mark.parametrize("size", [(640, 480), (64, 48), (8, 8)])
def test_pictures_of_any_size_take_labels(markers: list[tuple[int, float, float]], size: tuple[int, int]) -> None:
    sight = look(photograph(markers))
    image = np.zeros((size[1], size[0], 3), np.uint8)
    drawn = annotated(image, sight)
    assert drawn.shape == image.shape
    assert not image.any()


def test_a_video_is_told_when_its_markers_change(tmp_path: Path) -> None:
    video = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10, (640, 480))
    for markers in (GATE, GATE, GATE, [(40, 2.0, 0.0)], [(40, 2.0, 0.1)]):
        video.write(photograph(markers))
    video.release()
    lines = tral(tmp_path / "v.avi", "--every", 1, "--json").stdout.splitlines()
    records = [json.loads(line) for line in lines]
    assert [record["image"].rpartition(":")[2] for record in records] == ["0", "3"]
    assert [[marker["id"] for marker in record["markers"]] for record in records] == [[8, 9], [40]]


def video_of(images: list[np.ndarray], path: Path) -> Path:
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10, (640, 480))
    for image in images:
        video.write(image)
    video.release()
    return path


def test_a_reason_is_sought_only_where_the_markers_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[np.ndarray] = []

    def counted(image: np.ndarray, lens: CameraConfig | None = None) -> Sight:
        looked.append(image)
        return look(image, lens)

    monkeypatch.setattr("tral_env.perception.sight.look", counted)
    empty, half = photograph([]), photograph(GATE[:1])
    result = tral(video_of([empty] * 5 + [half] * 5 + [empty] * 2, tmp_path / "v.avi"), "--every", 1)
    assert result.exit_code == 0
    assert len(looked) == 3
    assert "v.avi:5:\n  marker 8: gate 4, left" in result.stdout


def test_at_the_end_of_a_video_it_is_told_how_far_it_was_looked_at(tmp_path: Path) -> None:
    result = tral(video_of([photograph(GATE)] * 7, tmp_path / "v.avi"), "--every", 3, "--json")
    assert len(result.stdout.splitlines()) == 1
    assert f"{tmp_path / 'v.avi'}: frame 7 of 7; looked at 3, 3 with markers, " in result.stderr


def test_ctrl_c_ends_a_video_and_keeps_what_was_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = video_of([photograph(GATE)] * 7, tmp_path / "v.avi")

    def watched(*_: object) -> Iterator[tuple[str, np.ndarray]]:
        yield f"{path}:0", photograph(GATE)
        yield f"{path}:5", photograph(GATE)
        raise KeyboardInterrupt

    monkeypatch.setattr("tral_env.calibration.image_sources.read_images", watched)
    result = tral(path)
    assert result.exit_code == 0
    assert "marker 8" in result.stdout
    assert f"Stopped. {path}: frame 6 of 7; looked at 2, 2 with markers, " in result.stderr


def test_images_with_a_colon_in_their_names_are_all_told(tmp_path: Path) -> None:
    for name in ("a:1.png", "a:2.png"):
        cv2.imwrite(str(tmp_path / name), photograph(GATE))
    assert len(tral(tmp_path, "--json").stdout.splitlines()) == 2


def test_ctrl_c_ends_a_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    def watched(*_: object) -> Iterator[tuple[str, np.ndarray]]:
        yield "/dev/video0:0", photograph(GATE)
        raise KeyboardInterrupt

    monkeypatch.setattr("tral_env.calibration.image_sources.read_images", watched)
    result = tral("/dev/video0")
    assert result.exit_code == 0
    assert "marker 8" in result.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.png"], "none.png: no such file or folder"),
        (["--lens", "wied", "."], "unknown lens 'wied': did you mean 'wide'?"),
        (["--out", "seen.gif", "."], "--out seen.gif: got suffix '.gif'"),
    ],
)
def test_bad_usage_ends_with_2(arguments: list[str], message: str) -> None:
    result = tral(*arguments)
    assert result.exit_code == 2
    assert message in result.stderr


def test_an_image_that_does_not_fit_the_lens_is_told_without_places_and_the_next_one_with_them(
    photo: Path, tmp_path: Path
) -> None:
    upright = tmp_path / "a.png"
    cv2.imwrite(str(upright), cv2.copyMakeBorder(photograph(GATE), 0, 400, 0, 0, cv2.BORDER_REPLICATE))
    result = tral(upright, photo, "--lens", "default")
    assert result.exit_code == 0
    first, second = result.stdout.split(f"{photo}:")
    assert "marker 8: gate 4, left\n" in first
    assert "! no places: the image is 640 x 880 px, the lens is for 640 x 480" in first
    assert "marker 8: gate 4, left: 3.0" in second


def test_a_first_image_that_cannot_be_read_takes_no_name_of_a_picture(photo: Path, tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(photo.read_bytes()[:20])
    assert tral(tmp_path / "a.png", photo, "--out", tmp_path / "seen.png").exit_code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "photo.png", "seen.png"]


def test_an_image_is_never_drawn_over(photo: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.png"
    other.write_bytes(photo.read_bytes())
    result = tral(photo, other, "--out", other)
    assert result.exit_code == 2
    assert "is one of the images: choose another name" in result.stderr
    assert other.read_bytes() == photo.read_bytes()
