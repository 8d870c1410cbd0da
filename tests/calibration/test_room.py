"""What the room of calibration may know, and the boards that it takes for usual."""

from __future__ import annotations

import pytest

from tral_env import geometry
from tral_env.calibration.boards import Board, Kind, printed_board
from tral_env.calibration.printables import SIZE_MM
from tral_env.config import CameraConfig
from tral_env.course.plan import Plan
from tral_env.errors import ConfigError


def test_the_usual_boards_fill_a_page() -> None:
    assert printed_board("charuco") == Board()
    assert printed_board("chessboard").size == pytest.approx((0.25, 0.175))


def test_a_marker_is_seven_ninths_of_a_square_of_any_size() -> None:
    assert printed_board("charuco", square_mm=18.0).marker == pytest.approx(0.014)


def test_a_board_of_no_columns_is_refused_instead_of_made_the_usual_one() -> None:
    with pytest.raises(ConfigError, match="columns = 0: expected a whole number of 3 or more"):
        printed_board("charuco", columns=0)


@pytest.mark.parametrize("kind", ["charuco", "chessboard"])
@pytest.mark.parametrize("edge", [-1, 0, True, "0.03", float("nan")])
def test_an_edge_that_is_no_length_is_refused(kind: Kind, edge: object) -> None:
    with pytest.raises(ConfigError, match=rf"Board\.square = {edge!r}: expected a length of 0.0001 to 100, in m"):
        Board(kind=kind, square=edge)  # type: ignore[arg-type]


@pytest.mark.parametrize("count", [2, 7.5, True])
def test_a_number_of_squares_that_cannot_be_is_refused(count: object) -> None:
    with pytest.raises(ConfigError, match=rf"Board\.rows = {count!r}: expected a whole number of 3 or more"):
        Board(rows=count)  # type: ignore[arg-type]


def test_an_unknown_board_is_told_with_the_nearest_name() -> None:
    with pytest.raises(ConfigError, match="did you mean 'charuco'"):
        printed_board("charucco")  # type: ignore[arg-type]


def test_markers_have_one_size_wherever_they_are_drawn_printed_or_seen() -> None:
    size = geometry.MARKER_SIZE_M
    assert size == CameraConfig().marker_size == SIZE_MM / 1000
    assert Plan.__dataclass_fields__["marker_size"].default == size
    cells = geometry.MARKER_MODULES + 2 * geometry.MARKER_QUIET_MODULES
    assert pytest.approx(size * cells / geometry.MARKER_MODULES) == geometry.MARKER_BOARD_WIDTH_M
