"""Boards: what is on them, and their corners in an image."""

import cv2
import numpy as np
import pytest
from board_world import photograph
from hypothesis import given
from hypothesis import strategies as st

from tral_env.calibration.board_poses import seeded_poses
from tral_env.calibration.boards import DICTIONARY, Board, marker_ink, printed_board
from tral_env.config import WIDE_LENS, CameraConfig
from tral_env.errors import ConfigError
from tral_env.perception.aruco import Detector
from tral_env.perception.dictionaries import dictionary, marker_modules
from tral_env.perception.rays import lens_arrays

CHARUCO = Board()
CHESS = Board(kind="chessboard", columns=10, rows=7, square=0.025)
BOARDS = pytest.mark.parametrize("board", [CHARUCO, CHESS], ids=["charuco", "chessboard"])


@BOARDS
def test_every_corner_is_found_where_it_is_printed(board):
    ids, pixels = board.find(board.image(2000.0, margin=0.02))
    order = np.argsort(ids)
    assert ids[order].tolist() == list(range(len(board.corners)))
    # The middle of pixel 0 lies half a pixel inside.
    assert pixels[order] == pytest.approx((board.corners[:, :2] + 0.02) * 2000.0 - 0.5, abs=0.02)


def test_a_chessboard_upside_down_has_the_same_corners():
    image = CHESS.image(2000.0, margin=0.02)
    ids, pixels = CHESS.find(np.ascontiguousarray(image[::-1, ::-1]))
    expected = np.array([image.shape[1], image.shape[0]]) - 0.5 - (CHESS.corners[:, :2] + 0.02) * 2000.0
    assert pixels[np.argsort(ids)] == pytest.approx(expected, abs=0.02)


def test_the_charuco_board_is_the_one_opencv_draws():
    layout = cv2.aruco.CharucoBoard((7, 5), 0.036, 0.028, dictionary(DICTIONARY))
    assert (CHARUCO.image(2000.0) == layout.generateImage((504, 360))).all()


@pytest.mark.parametrize("legacy", [False, True])
@pytest.mark.parametrize("name", ["DICT_4X4_50", "DICT_6X6_250", "DICT_APRILTAG_36h11"])
@pytest.mark.parametrize("size", [(8, 6), (7, 5), (6, 9), (5, 8)])
def test_boards_of_any_dictionary_and_pattern_are_those_that_opencv_draws(size, name, legacy):
    # All edges lie between two pixels.
    cells = marker_modules(name)
    square, marker = 0.001 * (cells + 2), 0.001 * cells
    board = Board(columns=size[0], rows=size[1], square=square, marker=marker, dictionary=name, legacy=legacy)
    layout = cv2.aruco.CharucoBoard(size, square, marker, dictionary(name))
    layout.setLegacyPattern(legacy)
    pixels = tuple(int(4 * (cells + 2) * count) for count in size)
    assert (board.image(4000.0) == layout.generateImage(pixels)).all()


def test_a_bought_board_is_found_by_its_options():
    board = printed_board("charuco", 8, 6, 35.0, 24.0, "4x4_50", legacy=True)
    assert board.dictionary == "DICT_4X4_50"
    assert sorted(board.find(board.image(2000.0, margin=0.02))[0]) == list(range(35))


def test_black_of_a_chessboard_is_half_of_it():
    assert CHESS.black[:, 2:].prod(axis=1).sum() == pytest.approx(35 * 0.025**2)


@given(st.integers(0, 49))
def test_ink_of_a_marker_is_its_code(marker):
    code = cv2.aruco.generateImageMarker(dictionary(DICTIONARY), marker, 7)
    drawn = np.full((7, 7), 255)
    for x, y, w, h in np.rint(marker_ink(DICTIONARY, marker) * 7).astype(int):
        assert (drawn[y : y + h, x : x + w] == 255).all()
        drawn[y : y + h, x : x + w] = 0
    assert (drawn == code).all()


def test_a_pixel_half_covered_by_black_is_grey():
    image = Board(kind="chessboard", columns=3, rows=3, square=0.0105).image(1000.0)
    assert image[0, 8:12].tolist() == [0, 0, 128, 255]


def test_the_gates_detector_sees_no_marker_on_a_board():
    assert len(Detector().detect(CHARUCO.image(2000.0, margin=0.02)).ids) == 0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kind": "chess"}, "did you mean 'chessboard'"),
        ({"kind": ["chessboard"]}, r"unknown board \['chessboard'\]: did you mean 'chessboard'"),
        ({"columns": 2}, "Board.columns = 2: expected a whole number of 3 or more"),
        ({"square": 0.0}, "Board.square = 0.0: expected a length of 0.0001 to 100"),
        ({"square": float("nan")}, "Board.square = nan"),
        ({"square": 1e-300, "marker": 1e-301}, "Board.square = 1e-300: expected a length of 0.0001 to 100, in m"),
        ({"square": 1e6}, "Board.square = 1000000.0: expected a length of 0.0001 to 100, in m"),
        ({"marker": 0.036}, "expected less than the square's 0.036 m"),
        ({"columns": 12, "rows": 9}, "needs 54 markers, and there are 50 in DICT_5X5_50: .* or a larger dictionary"),
        ({"dictionary": "5x5_5"}, "unknown dictionary '5x5_5': did you mean 'DICT_5X5_50'"),
    ],
)
def test_an_impossible_board_is_refused(values, message):
    with pytest.raises(ConfigError, match=message):
        Board(**values)


@BOARDS
@pytest.mark.parametrize("lens", [WIDE_LENS, CameraConfig()], ids=["wide", "default"])
def test_seeded_poses_keep_the_board_in_view(board, lens):
    needed = 0.6 if board.kind == "charuco" else 1.0
    for pose in seeded_poses(board, lens, 20, 1):
        points = pose.place(board, board.corners)
        pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), *lens_arrays(lens))[0][:, 0]
        inside = ((pixels > 0) & (pixels < [lens.width - 1, lens.height - 1])).all(axis=1)
        assert points[:, 2].min() > 0
        assert inside.mean() >= needed


def test_seeded_poses_are_those_of_their_seed():
    once, again, other = (seeded_poses(CHARUCO, WIDE_LENS, 5, seed) for seed in (3, 3, 4))
    assert all(
        (a.middle == b.middle).all() and (a.rotation == b.rotation).all() for a, b in zip(once, again, strict=True)
    )
    assert not (once[0].middle == other[0].middle).all()


@BOARDS
def test_corners_of_a_photograph_lie_where_the_lens_puts_them(board):
    for pose in seeded_poses(board, WIDE_LENS, 4, 5):
        ids, pixels = board.find(photograph(board, WIDE_LENS, pose))
        points = pose.place(board, board.corners[ids])
        expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), *lens_arrays(WIDE_LENS))[0][:, 0]
        assert np.sqrt(np.mean(np.sum((pixels - expected) ** 2, axis=1))) < 0.15
