"""From views to a lens: known truth is found again, and what is missing is said."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from board_world import photograph
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tral_env.calibration.board_hints import BoardHint
from tral_env.calibration.board_poses import BoardPose, seeded_poses
from tral_env.calibration.boards import Board
from tral_env.calibration.solve import LIMITS, PARAMETERS, TooFewViewsError, calibrate, calibrate_collection, uncovered
from tral_env.calibration.views import Collection, Rejected, View
from tral_env.config import WIDE_LENS, CameraConfig
from tral_env.errors import CalibrationError, ConfigError
from tral_env.perception.rays import lens_arrays
from tral_env.simulation.board_scene import BoardScene

BOARD = Board()
CHESS = Board(kind="chessboard", columns=10, rows=7, square=0.025)
SIZE = (640, 480)


def numbers(lens: CameraConfig) -> np.ndarray:
    return np.array([lens.fx, lens.fy, lens.cx, lens.cy, *lens.distortion])


def seen(board: Board, lens: CameraConfig, poses: list[BoardPose], noise: float = 0.05, seed: int = 0) -> list[View]:
    """Views without images: corners projected, with normal noise, px."""
    rng = np.random.default_rng(seed)
    views = []
    for i, pose in enumerate(poses):
        points = pose.place(board, board.corners)
        pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), *lens_arrays(lens))[0][:, 0]
        pixels += rng.normal(0, noise, pixels.shape)
        inside = np.flatnonzero(((pixels > 0) & (pixels < [lens.width - 1, lens.height - 1])).all(axis=1))
        views.append(View(f"view {i}", inside, pixels[inside], 2.0))
    return views


def poses(count: int = 20, seed: int = 2) -> list[BoardPose]:
    return seeded_poses(BOARD, WIDE_LENS, count, seed)


@pytest.mark.parametrize("board", [BOARD, CHESS], ids=["charuco", "chessboard"])
def test_the_wide_lens_is_found_again_from_photographs(board):
    collection = Collection(board)
    for i, pose in enumerate(seeded_poses(board, WIDE_LENS, 12, 0)):
        collection.add(f"shot {i}", photograph(board, WIDE_LENS, pose))
    result = calibrate_collection(collection)
    found, true = numbers(result.camera), numbers(WIDE_LENS)
    assert len(result.views) >= 11
    assert found[:2] == pytest.approx(true[:2], rel=0.001)
    assert found[2:4] == pytest.approx(true[2:4], abs=0.4)
    assert found[4:] == pytest.approx(true[4:], abs=0.001)
    assert result.rms_px < 0.08
    assert result.held_out_px < 0.08


@pytest.mark.usefixtures("opengl")
def test_the_wide_lens_of_the_simulated_camera_is_found_again():
    stage, collection = BoardScene(BOARD, WIDE_LENS, degradation=1.0), Collection(BOARD)
    try:
        for i, pose in enumerate(poses()):
            collection.add(f"shot {i}", stage.capture(pose))
    finally:
        stage.close()
    result = calibrate_collection(collection)
    found, true = numbers(result.camera), numbers(WIDE_LENS)
    assert found[:2] == pytest.approx(true[:2], rel=0.003)
    assert found[2:4] == pytest.approx(true[2:4], abs=0.8)
    assert found[4:] == pytest.approx(true[4:], abs=0.002)
    assert result.held_out_px < 0.12


@settings(max_examples=10)
@given(st.floats(300, 900), st.floats(0.95, 1.05), st.floats(-30, 30), st.floats(-30, 30), st.floats(-0.2, 0.05))
def test_any_lens_is_found_from_exact_corners(focal, aspect, right, down, k1):
    # below k1 = -0.149 a lens folds where 1 + 3 k1 r^2 + 5 0.01 r^4 = 0: outside the image of a longer one
    assume(k1 > -0.149 or focal > 520)
    lens = CameraConfig(
        fx=focal, fy=focal * aspect, cx=319.5 + right, cy=239.5 + down, distortion=(k1, 0.01, 0.001, -0.001, 0.0)
    )
    views = seen(BOARD, lens, seeded_poses(BOARD, lens, 12, 1), noise=0.0)
    result = calibrate(BOARD, views, SIZE)
    assert numbers(result.camera) == pytest.approx(numbers(lens), rel=1e-3, abs=1e-3)
    assert result.rms_px < 0.01


def test_standard_deviations_tell_how_far_off_the_parameters_are():
    errors = []
    for seed in range(6):
        result = calibrate(BOARD, seen(BOARD, WIDE_LENS, poses(), noise=0.3, seed=seed), SIZE)
        deviation = np.array([result.deviation[name] for name in PARAMETERS])
        errors.append((numbers(result.camera) - numbers(WIDE_LENS))[:8] / deviation[:8])
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 1.6


def test_the_held_out_error_is_that_of_the_corners():
    result = calibrate(BOARD, seen(BOARD, WIDE_LENS, poses(), noise=0.3), SIZE)
    # Two coordinates of 0.3 px, a little less for the six numbers of each pose.
    assert 0.35 < result.rms_px < result.held_out_px < 0.45


def test_two_radial_terms_leave_the_third_at_zero_and_three_do_not():
    lens = replace(WIDE_LENS, distortion=(-0.2, 0.05, 0.0, 0.0, -0.01))
    views = seen(BOARD, lens, poses(12), noise=0.0)
    assert calibrate(BOARD, views, SIZE).camera.distortion[4] == 0.0
    assert calibrate(BOARD, views, SIZE, radial=3).camera.distortion[4] == pytest.approx(-0.01, abs=1e-4)


def test_a_view_whose_error_stands_out_is_left_out():
    views = seen(BOARD, WIDE_LENS, poses())
    bent = views[7].pixels + np.random.default_rng(0).normal(0, 3.0, views[7].pixels.shape)
    views[7] = replace(views[7], pixels=bent)
    result = calibrate(BOARD, views, SIZE)
    assert [(one.name, one.reason) for one in result.rejected] == [("view 7", "outlier error")]
    assert len(result.views) == len(result.errors_px) == 19
    assert result.good


def test_distances_and_tilts_are_those_of_the_poses():
    given_poses = poses()
    result = calibrate(BOARD, seen(BOARD, WIDE_LENS, given_poses, noise=0.01), SIZE)
    assert result.distances == pytest.approx([np.linalg.norm(pose.middle) for pose in given_poses], rel=0.003)
    assert result.normals == pytest.approx(np.array([pose.rotation[:, 2] for pose in given_poses]), abs=0.01)


def advice_on(chosen: list[BoardPose], noise: float = 0.05) -> str:
    return "; ".join(calibrate(BOARD, seen(BOARD, WIDE_LENS, chosen, noise), SIZE).advice)


def test_good_views_need_no_advice():
    assert advice_on(poses()) == ""


def test_few_views_are_too_few():
    assert "8 views were used: take 12 or more" in advice_on(poses(8))


def test_parts_of_the_image_without_corners_are_named():
    left = [pose for pose in poses(40) if pose.middle[0] < -0.05]
    assert "few corners in these parts of the image: bring the board there: upper right" in advice_on(left)


def test_a_board_held_flat_is_to_be_tilted():
    flat = [replace(pose, rotation=np.eye(3)) for pose in poses()]
    assert "comes nearer: its right side, its left side, its lower side, its upper side" in advice_on(flat)


def test_a_board_never_tilted_to_one_side_is_to_be_tilted_there():
    tilted = [pose for pose in poses(40) if pose.rotation[0, 2] < 0.1]
    assert "comes nearer: its right side" in advice_on(tilted)


def test_one_distance_is_not_enough():
    rays = [pose.middle / np.linalg.norm(pose.middle) for pose in poses()]
    same = [replace(pose, middle=0.3 * ray) for pose, ray in zip(poses(), rays, strict=True)]
    assert "the farthest view is only 1.0 times as far as the nearest" in advice_on(same)


def test_a_board_that_is_not_flat_is_suspected():
    assert "is the board flat and stiff" in advice_on(poses(), noise=1.0)


@pytest.mark.parametrize("radial", [0, 4, 9])
def test_a_number_of_radial_terms_that_no_lens_has_is_refused(radial: int):
    with pytest.raises(ConfigError, match=f"radial = {radial}: expected 1, 2 or 3"):
        calibrate(BOARD, seen(BOARD, WIDE_LENS, poses(6), noise=0.0), SIZE, radial=radial)


def test_each_focal_length_is_judged_by_itself():
    lens = CameraConfig(fx=800.0, fy=400.0)
    views = seen(BOARD, lens, seeded_poses(BOARD, lens, 12, 1), noise=0.3)
    deviation = calibrate(BOARD, views, SIZE).deviation["fy"]
    between = replace(LIMITS, focal_std=deviation / 600.0)  # more than a share of 400 px, less than one of 800 px
    assert any("fy uncertain by" in told for told in calibrate(BOARD, views, SIZE, limits=between).advice)


def test_uncertain_parameters_ask_for_more():
    assert "fx and fy uncertain by" in advice_on(poses(6), noise=0.6)


def test_fewer_than_four_views_are_refused_with_the_reasons():
    rejected = [Rejected("a", "no board", ""), Rejected("b", "no board", ""), Rejected("c", "too blurred", "")]
    with pytest.raises(
        CalibrationError, match=r"3 of 6 images .*\(2 x no board, 1 x too blurred\).*the one that was named"
    ):
        calibrate(BOARD, seen(BOARD, WIDE_LENS, poses(3)), SIZE, rejected=rejected)


def test_too_few_views_tell_the_limit_that_was_given_and_the_board_that_was_seen():
    hint = BoardHint("the image shows another board", {"columns": 8, "legacy": True})
    rejected = [Rejected("a", "no board", "nothing; at all"), Rejected("b", "no board", "nothing", hint)]
    with pytest.raises(TooFewViewsError) as refused:
        calibrate(BOARD, [], SIZE, rejected=rejected, limits=replace(LIMITS, views=20))
    assert "a calibration needs 4, a good one 20" in str(refused.value)
    assert str(refused.value).endswith("named? Hint: the image shows another board: columns=8, legacy=True")
    assert refused.value.hint == hint


def test_uncovered_parts_are_thirds_of_the_image():
    counts = np.ones((6, 9), np.int64)
    counts[:2, :3] = 0
    counts[4:, 3] = 0
    assert uncovered(counts) == ["upper left"]
