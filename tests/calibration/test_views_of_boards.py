"""Which images are of use for a calibration, and why the others are not."""

import cv2
import numpy as np
import pytest
from board_world import photograph

from tral_env.calibration.board_poses import BoardPose
from tral_env.calibration.boards import Board
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


def test_images_of_another_size_are_refused(shot):
    collection = Collection(BOARD)
    collection.add("first", shot)
    with pytest.raises(CalibrationError, match="second is 320 x 240 px, the images before it 640 x 480"):
        collection.add("second", cv2.resize(shot, (320, 240)))


def test_coverage_counts_corners_in_their_cells():
    # Nine cells of 10 px across, six of 10 px down; a cell reaches from half a pixel before its first pixel's middle.
    pixels = np.array([[0.0, 0.0], [9.4, 9.4], [9.6, 0.0], [89.0, 59.0]])
    counts = coverage([View("shot", np.arange(4), pixels, 2.0)], (90, 60))
    assert counts.shape == (6, 9)
    assert (counts[0, 0], counts[0, 1], counts[5, 8], counts.sum()) == (2, 1, 1, 4)
