"""`tral calibrate` from images, a video and the simulated camera."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from board_world import photograph
from typer.testing import CliRunner, Result

from tral_env.calibration.board_hints import BoardHint
from tral_env.calibration.board_poses import seeded_poses
from tral_env.calibration.boards import Board, printed_board
from tral_env.calibration.camera_info import read_camera_info, write_camera_info
from tral_env.calibration.image_sources import read_images
from tral_env.calibration.record import difference_px
from tral_env.calibration.solve import Limits
from tral_env.config import WIDE_LENS, CameraConfig
from tral_env.simulation.board_scene import MARGIN, pixels_per_metre
from tral_fsm.cli import app
from tral_fsm.cli.board_options import hint_as_options

SHOTS = 18


def tral(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["calibrate", *(str(argument) for argument in arguments)])


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Photographs of a board through the wide lens, one of them twice, and one of nothing."""
    folder = tmp_path_factory.mktemp("shots")
    for i, pose in enumerate(seeded_poses(Board(), WIDE_LENS, SHOTS, 0)):
        cv2.imwrite(str(folder / f"{i:02d}.png"), photograph(Board(), WIDE_LENS, pose))
    (folder / "17b.png").write_bytes((folder / "17.png").read_bytes())
    cv2.imwrite(str(folder / "empty.png"), np.full((480, 640), 128, np.uint8))
    return folder


@pytest.fixture(scope="module")
def calibrated(shots: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    out = tmp_path_factory.mktemp("runs") / "good"
    return out, tral(shots, "--out", out, "--json")


def test_a_good_calibration_ends_with_0_and_its_files(calibrated: tuple[Path, Result]) -> None:
    out, result = calibrated
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in out.iterdir()) == ["calibration.json", "camera_info.yaml", "coverage.png"]


def test_its_lens_is_the_one_that_took_the_images(calibrated: tuple[Path, Result]) -> None:
    lens = read_camera_info(calibrated[0] / "camera_info.yaml")
    assert (lens.fx, lens.fy) == pytest.approx((WIDE_LENS.fx, WIDE_LENS.fy), rel=0.003)
    assert difference_px(lens, WIDE_LENS)[0] < 0.4


def test_json_is_the_file_and_nothing_else(calibrated: tuple[Path, Result]) -> None:
    out, result = calibrated
    report = json.loads(result.stdout)
    assert report == json.loads((out / "calibration.json").read_text())
    assert report["verdict"] == "good"
    assert report["advice"] == []
    assert 0 < report["rms_px"] <= report["held_out_rms_px"] < 0.1
    assert np.sum(report["coverage"]) == sum(view["corners"] for view in report["views"])


def test_rejected_images_are_named_with_the_reason(calibrated: tuple[Path, Result]) -> None:
    rejected = {Path(one["name"]).name: one["reason"] for one in json.loads(calibrated[1].stdout)["rejected"]}
    assert rejected["17b.png"] == "duplicate pose"
    assert rejected["empty.png"] == "no board"


def test_a_corrupt_image_is_rejected_by_name_and_the_others_are_used(
    calibrated: tuple[Path, Result], shots: Path, tmp_path: Path
) -> None:
    for file in shots.glob("*.png"):
        (tmp_path / file.name).symlink_to(file)
    (tmp_path / "00a.png").write_bytes((shots / "00.png").read_bytes()[:10])
    result = tral(tmp_path, "--out", tmp_path / "out", "--json", "--keep-images")
    report = json.loads(result.stdout)
    assert result.exit_code == 0
    assert [Path(one["name"]).name for one in report["rejected"] if one["reason"] == "unreadable"] == ["00a.png"]
    assert report["coverage"] == json.loads(calibrated[1].stdout)["coverage"]


def test_a_corrupt_video_alone_is_named(tmp_path: Path) -> None:
    (tmp_path / "walk.mp4").write_bytes(b"broken")
    result = tral(tmp_path / "walk.mp4", "--out", tmp_path / "out")
    assert result.exit_code == 1
    assert "0 of 1 images show the board well enough (1 x unreadable)" in " ".join(result.stderr.split())
    assert "walk.mp4" in result.stderr.split("Unreadable:")[1]


def test_the_coverage_map_is_a_picture(calibrated: tuple[Path, Result]) -> None:
    image = cv2.imread(str(calibrated[0] / "coverage.png"))
    assert image is not None
    assert min(image.shape[:2]) > 300
    assert image.std() > 10


def test_a_poor_calibration_ends_with_1_says_why_and_spares_the_good_one(shots: Path, tmp_path: Path) -> None:
    write_camera_info(tmp_path / "camera_info.yaml", CameraConfig())
    result = tral(shots / "0[0-5].png", "--out", tmp_path)
    assert result.exit_code == 1
    assert f"views were used: take {Limits().views} or more" in result.stdout
    assert read_camera_info(tmp_path / "camera_info.yaml") == CameraConfig()
    assert read_camera_info(tmp_path / "poor_camera_info.yaml").fx == pytest.approx(335.9, rel=0.01)


def test_a_good_calibration_takes_away_the_poor_one_before_it(shots: Path, tmp_path: Path) -> None:
    (tmp_path / "poor_camera_info.yaml").write_text("from before")
    assert tral(shots, "--out", tmp_path, "--name", "webcam").exit_code == 0
    assert not (tmp_path / "poor_camera_info.yaml").exists()
    assert "camera_name: webcam" in (tmp_path / "camera_info.yaml").read_text()


def test_what_is_printed_has_numbers_errors_and_verdict(shots: Path, tmp_path: Path) -> None:
    result = tral(shots, "--out", tmp_path)
    assert "std. dev." in result.stdout
    assert "held out 0.0" in result.stdout
    assert "Rejected, duplicate pose: 1" in result.stdout
    assert "\ngood\n" in result.stdout
    assert "20 of 20 images" in result.stderr


def test_a_video_is_looked_at_frame_by_frame(shots: Path, tmp_path: Path) -> None:
    video = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10, (640, 480))
    for path in sorted(shots.glob("[01]*.png"))[:12]:
        image = cv2.imread(str(path))
        assert image is not None
        for _ in range(2):
            video.write(image)
    video.release()
    report = json.loads(tral(tmp_path / "v.avi", "--every", 2, "--out", tmp_path, "--json").stdout)
    assert 8 <= len(report["views"]) <= 12
    assert report["views"][0]["name"].endswith("v.avi:0")


def test_ctrl_c_ends_the_looking_of_a_camera(shots: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def watched(*_: object) -> Iterator[tuple[str, np.ndarray]]:
        yield from read_images([str(path) for path in sorted(shots.glob("0*.png"))])
        raise KeyboardInterrupt

    monkeypatch.setattr("tral_env.calibration.image_sources.read_images", watched)
    result = tral("/dev/video0", "--out", tmp_path)
    assert result.exit_code == 1
    assert "Ctrl-C: enough" in result.stderr
    assert (tmp_path / "poor_camera_info.yaml").exists()


def test_kept_images_of_one_name_do_not_replace_each_other(shots: Path, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "00.png").write_bytes((shots / "01.png").read_bytes())
    tral(shots / "00.png", tmp_path / "other" / "00.png", "--keep-images", "--out", tmp_path / "out")
    kept = sorted((tmp_path / "out" / "images").iterdir())
    assert [path.name for path in kept] == ["0001_00_png.png", "0002_00_png.png"]
    assert np.array_equal(cv2.imread(str(kept[1])), cv2.imread(str(shots / "01.png")))


def test_a_large_board_takes_no_more_memory_than_a_small_one() -> None:
    assert pixels_per_metre(Board()) == 4000
    hall = Board(columns=13, rows=7, square=1.0, marker=0.8)
    assert pixels_per_metre(hall) * (13 + 2 * MARGIN) == pytest.approx(4096)


def test_enough_views_end_the_looking(shots: Path, tmp_path: Path) -> None:
    report = json.loads(tral(shots, "--max-views", 5, "--out", tmp_path, "--json").stdout)
    assert len(report["views"]) + len([one for one in report["rejected"] if one["reason"] == "outlier error"]) == 5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "nothing to look at: name images, a folder, a video or a camera, or use --simulated"),
        (["--square-mm", "0.036", "."], "square_mm = 0.036: is that metres? In millimetres it is 36"),
        (["--marker-mm", "0.028", "."], "marker_mm = 0.028: is that metres? In millimetres it is 28"),
        (["--dictionary", "4X4_5", "."], "unknown dictionary '4X4_5': did you mean 'DICT_4X4_50'?"),
        (["--square-mm", "0", "."], "square_mm = 0: expected a length of 1 to 100000, in mm"),
        (["--marker-mm", "0", "."], "marker_mm = 0: expected a length of 1 to 100000, in mm"),
        (["--simulated", "a.png"], "--simulated makes its own images: leave out a.png"),
        (["none.png"], "none.png: no such file or folder"),
        (["--simulated", "--lens", "wied"], "unknown lens 'wied': did you mean 'wide'?"),
        (["--simulated", "--square-mm", "-3"], "square_mm = -3: expected a length of 1 to 100000, in mm"),
    ],
)
def test_bad_usage_ends_with_2(arguments: list[str], message: str, tmp_path: Path) -> None:
    result = tral(*arguments, "--out", tmp_path / "new")
    assert result.exit_code == 2
    assert message in result.stderr
    assert not (tmp_path / "new").exists()


def test_images_of_another_board_are_refused_with_the_reasons(shots: Path, tmp_path: Path) -> None:
    result = tral(shots / "0[0-3].png", "--board", "chessboard", "--out", tmp_path)
    assert result.exit_code == 1
    assert "0 of 4 images show the board well enough (4 x no board)" in result.stderr
    assert "Is the board the one that was named? Hint: the image shows markers: --board charuco" in " ".join(
        result.stderr.split()
    )


@pytest.mark.parametrize(
    ("fields", "options"),
    [
        ({"columns": 8, "rows": 6}, ": --columns 8 --rows 6"),
        ({"dictionary": "DICT_4X4_50", "legacy": True}, ": --dictionary 4X4_50 --legacy"),
        ({"legacy": False}, ": without --legacy"),
        ({"kind": "charuco"}, ": --board charuco"),
        ({}, ""),
    ],
)
def test_a_hint_at_another_board_is_worded_as_options(fields: dict, options: str) -> None:
    assert hint_as_options(BoardHint("another board", fields)) == f"another board{options}"


def test_a_bought_board_is_printed_and_found_with_the_same_options(tmp_path: Path) -> None:
    options = ["--columns", "8", "--rows", "6", "--square-mm", "35", "--marker-mm", "24"]
    options += ["--dictionary", "4X4_50", "--legacy"]
    assert (
        CliRunner()
        .invoke(app, ["print", "board", *options, "--paper", "A3", "--out", str(tmp_path / "b.svg")])
        .exit_code
        == 0
    )
    assert "markers of 24 mm, DICT_4X4_50, legacy" in (tmp_path / "b.svg").read_text()
    board = printed_board("charuco", 8, 6, 35.0, 24.0, "4X4_50", legacy=True)
    for i, pose in enumerate(seeded_poses(board, WIDE_LENS, 6, 0)):
        cv2.imwrite(str(tmp_path / f"{i}.png"), photograph(board, WIDE_LENS, pose))
    report = json.loads(tral(tmp_path / "*.png", *options, "--out", tmp_path / "out", "--json").stdout)
    assert len(report["views"]) >= 4
    assert (report["board"]["dictionary"], report["board"]["legacy"]) == ("DICT_4X4_50", True)
    assert report["parameters"]["fx"] == pytest.approx(335.9, rel=0.02)


def test_one_image_of_another_size_is_left_out_with_a_word(shots: Path, tmp_path: Path) -> None:
    image = cv2.imread(str(shots / "05.png"))
    assert image is not None
    cv2.imwrite(str(tmp_path / "large.png"), cv2.resize(image, (800, 600)))
    result = tral(tmp_path / "large.png", shots / "0[0-5].png", "--out", tmp_path / "out")
    assert "Rejected, other size: 1" in result.stdout
    assert "large.png: 800 x 600 px, most are 640 x 480" in " ".join(result.stdout.split())


def test_what_is_shown_in_a_narrow_terminal_is_whole_and_an_error_begins_a_line(shots: Path, tmp_path: Path) -> None:
    shown = tral(shots / "0[0-3].png", "--board", "chessboard", "--out", tmp_path).stderr
    assert "lower left, lower middle, lower right" in " ".join(shown.split())
    assert "\nError: 0 of 4 images" in shown


@pytest.mark.usefixtures("opengl")
def test_the_simulated_camera_calibrates_itself_and_says_how_far_off_it_is(tmp_path: Path) -> None:
    arguments = ("--simulated", "--shots", 16, "--seed", 2, "--keep-images", "--out", tmp_path)
    report = json.loads(tral(*arguments, "--json").stdout)
    assert max(abs(report["error_percent"][name]) for name in ("fx", "fy")) < 0.5
    assert max(abs(report["error_percent"][name]) for name in ("cx", "cy")) < 1.0
    assert len(list((tmp_path / "images").glob("*_simulated_*.png"))) == 16


def test_difference_of_lenses_is_in_pixels() -> None:
    moved = CameraConfig(cx=319.5 + 3, cy=239.5 + 4)
    assert difference_px(moved, CameraConfig()) == pytest.approx((5.0, 5.0))


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys; from typer.testing import CliRunner; from tral_fsm.cli import app;"
        "[CliRunner().invoke(app, [name, '--help']) for name in ('calibrate', 'print', 'detect')];"
        "print({'mujoco', 'cv2', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
