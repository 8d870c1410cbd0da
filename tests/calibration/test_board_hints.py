"""What is said of an image that shows another board."""

import numpy as np

from tral_env.calibration.board_hints import other_board
from tral_env.calibration.boards import printed_board


def test_a_hint_that_would_need_more_markers_than_there_are_is_left_out() -> None:
    board = printed_board("charuco", columns=10, rows=10)
    assert other_board(board, np.full((240, 320), 200, np.uint8)) is None
