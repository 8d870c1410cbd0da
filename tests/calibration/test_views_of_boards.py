"""Which images are of use for a calibration, and why the others are not."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from board_world import photograph
from hypothesis import given
from hypothesis import strategies as st

from tral_env.calibration.board_hints import other_board
from tral_env.calibration.board_poses import BoardPose
from tral_env.calibration.boards import Board, search_copy
from tral_env.calibration.solve import calibrate_collection
from tral_env.calibration.views import Collection, Rejected, View, coverage, edge_width
from tral_env.config import WIDE_LENS
from tral_env.errors import CalibrationError

BOARD = Board()
AHEAD = BoardPose(np.eye(3), np.array([0.0, 0.0, 0.2]))


@pytest.fixture(scope="module")
def shot():
    return photograph(BOARD, WIDE_LENS, AHEAD)


def reason(collection, image):
    seen = collection.add("shot", image)
    assert isinstance(seen, Rejected)
    return seen.reason


def test_a_sharp_board_is_of_use(shot):
    seen = Collection(BOARD).add("shot", shot)
    assert isinstance(seen, View)
    assert len(seen.ids) == 24


def test_colours_are_read_as_grey(shot):
    seen = Collection(BOARD).add("shot", cv2.cvtColor(shot, cv2.COLOR_GRAY2BGR))
    assert isinstance(seen, View)


def test_an_empty_image_has_no_board(shot):
    assert reason(Collection(BOARD), np.full_like(shot, 128)) == "no board"


def test_a_hand_before_the_board_leaves_too_few_corners(shot):
    hidden = shot.copy()
    hidden[:, :400] = 120
    assert reason(Collection(BOARD), hidden) == "too few corners"


@pytest.mark.parametrize("motion", [(7, 1), (1, 7)], ids=["across", "down"])
def test_motion_blurs_a_board_along_one_direction(shot, motion):
    assert reason(Collection(BOARD), cv2.blur(shot, motion)) == "too blurred"


def test_a_board_out_of_focus_is_too_blurred(shot):
    assert reason(Collection(BOARD), cv2.GaussianBlur(shot, (0, 0), 2.5)) == "too blurred"


def test_edge_width_follows_the_blur(shot):
    sharp = photograph(BOARD, WIDE_LENS, AHEAD, blur=0)
    ids, pixels = BOARD.find(sharp)
    moved, soft = cv2.blur(sharp, (5, 1)), cv2.GaussianBlur(sharp, (0, 0), 1.2)
    widths = [edge_width(BOARD, image, ids, pixels) for image in (sharp, moved, soft)]
    assert widths == pytest.approx([2.0, 5.0, np.sqrt(4 + 6 * 1.2**2)], rel=0.05)


def test_the_same_pose_counts_once(shot):
    collection = Collection(BOARD)
    collection.add("first", shot)
    seen = collection.add("second", np.roll(shot, 3, axis=1))
    assert isinstance(seen, Rejected)
    assert (seen.reason, seen.detail) == ("duplicate pose", "as in first")


def test_a_board_moved_aside_is_another_view(shot):
    collection = Collection(BOARD)
    collection.add("first", shot)
    assert isinstance(collection.add("second", np.roll(shot, 20, axis=1)), View)


def test_rejections_are_counted_by_reason(shot):
    collection = Collection(BOARD)
    for image in (shot, shot, np.zeros_like(shot), shot):
        collection.add("shot", image)
    assert collection.reasons() == {"no board": 1, "duplicate pose": 2}


def moved(shot, count):
    return [np.roll(shot, 20 * i, axis=1) for i in range(count)]


@pytest.mark.parametrize("place", [0, 1, 3])
def test_an_image_of_another_size_is_left_out_wherever_it_comes(shot, place):
    images = moved(shot, 3)
    images.insert(place, cv2.resize(shot, (800, 600)))
    collection = Collection(BOARD)
    for i, image in enumerate(images):
        collection.add(str(i), image)
    assert collection.size == (640, 480)
    assert len(collection.views) == 3
    assert collection.rejected == [Rejected(str(place), "other size", "800 x 600 px, most are 640 x 480")]


def test_an_image_taken_upright_is_left_out_with_a_guess(shot):
    collection = Collection(BOARD)
    for image in (shot, np.rot90(shot)):
        collection.add("shot", np.ascontiguousarray(image))
    assert collection.rejected[0].detail == "480 x 640 px, most are 640 x 480; was the camera turned?"


def test_images_that_all_differ_in_size_are_no_calibration(shot):
    collection = Collection(BOARD)
    for size in ((640, 480), (800, 600), (960, 720), (720, 540)):
        collection.add("shot", cv2.resize(shot, size))
    with pytest.raises(CalibrationError, match=r"1 of 4 .*3 x other size.*one size of image"):
        calibrate_collection(collection)


def test_a_board_on_twelve_megapixels_is_found_as_exactly_as_on_a_small_image():
    board = Board(kind="chessboard", columns=10, rows=7, square=0.025)
    image = np.full((3000, 4000), 128, np.uint8)
    drawn = board.image(8000.0, margin=0.02)
    image[300 : 300 + drawn.shape[0], 500 : 500 + drawn.shape[1]] = drawn
    ids, pixels = board.find(image)
    expected = (board.corners[:, :2] + 0.02) * 8000.0 - 0.5 + (500, 300)
    assert pixels[np.argsort(ids)] == pytest.approx(expected, abs=0.02)


@given(st.integers(1, 5000), st.integers(1, 5000))
def test_a_search_copy_is_small_and_covers_the_image(width, height):
    small, scale = search_copy(np.zeros((height, width), np.uint8))
    assert max(small.shape) <= max(1280, 1)
    assert small.shape[::-1] * scale == pytest.approx((width, height))


BOUGHT = Board(columns=8, rows=6, square=0.035, marker=0.024, dictionary="4X4_50", legacy=True)


@pytest.mark.parametrize(
    ("named", "hint"),
    [
        ({"legacy": False}, "the image shows another board: legacy=True"),
        ({"dictionary": "DICT_5X5_50"}, "the image shows another board: dictionary='DICT_4X4_50'"),
        ({"dictionary": "DICT_6X6_250", "legacy": False}, "another board: dictionary='DICT_4X4_50', legacy=True"),
        ({"columns": 7, "rows": 5}, "the image shows another board: columns=8, rows=6"),
        ({"columns": 6, "rows": 8}, "the image shows another board: columns=8, rows=6"),
        ({"columns": 5, "rows": 4}, "are columns and rows those of the board?"),
        ({"kind": "chessboard"}, "the image shows markers: kind='charuco'"),
    ],
)
def test_a_board_with_other_options_is_told(named, hint):
    image = BOUGHT.image(2000.0, margin=0.02)
    assert len(BOUGHT.find(image)[0]) == 35
    seen = Collection(replace(BOUGHT, **named)).add("shot", image)
    assert isinstance(seen, Rejected)
    assert seen.reason == "no board"
    assert str(seen.hint).endswith(hint)
    assert all(getattr(BOUGHT, name) == value for name, value in seen.hint.fields.items())


def test_inner_corners_counted_as_squares_are_told():
    image = Board(kind="chessboard", columns=7, rows=10, square=0.025).image(2000.0, margin=0.02)
    seen = Collection(Board(kind="chessboard", columns=6, rows=9, square=0.025)).add("shot", image)
    assert isinstance(seen, Rejected)
    assert str(seen.hint) == "6 x 9 inner corners are 7 x 10 squares: columns=7, rows=10"


def test_an_empty_image_shows_no_other_board(shot):
    for board in (BOARD, BOUGHT, Board(kind="chessboard")):
        assert other_board(board, np.full_like(shot, 128)) is None


def test_coverage_counts_corners_in_their_cells():
    # Nine cells of 10 px across, six of 10 px down; a cell reaches from half a pixel before its first pixel's middle.
    pixels = np.array([[0.0, 0.0], [9.4, 9.4], [9.6, 0.0], [89.0, 59.0]])
    counts = coverage([View("shot", np.arange(4), pixels, 2.0)], (90, 60))
    assert counts.shape == (6, 9)
    assert (counts[0, 0], counts[0, 1], counts[5, 8], counts.sum()) == (2, 1, 1, 4)
