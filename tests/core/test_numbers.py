"""What counts as a number."""

import math
from fractions import Fraction

import numpy as np
import pytest

from tral_env.calibration.boards import Board
from tral_env.checks import is_number, is_seed
from tral_env.options import is_count


@pytest.mark.parametrize("value", [0, -1, 2.5, np.int64(5), np.float32(0.5), Fraction(1, 3)])
def test_a_number_of_python_or_numpy_is_one(value: object) -> None:
    assert is_number(value)


@pytest.mark.parametrize("value", [True, np.True_, None, "5", math.nan, math.inf, 10**400, [1], 1j])
def test_a_truth_value_a_text_and_what_is_not_finite_are_no_numbers(value: object) -> None:
    assert not is_number(value)
    assert not is_count(value)


@pytest.mark.parametrize(
    ("value", "is_whole"), [(5, True), (np.int64(5), True), (5.0, False), (np.float64(5.0), False)]
)
def test_a_whole_number_is_one_by_its_type(value: object, is_whole: bool) -> None:
    assert is_number(value, whole=True) == is_whole
    assert is_count(value) == is_whole
    assert is_seed(value) == is_whole


def test_a_board_takes_whole_numbers_of_numpy() -> None:
    assert Board(columns=np.int64(7)) == Board(columns=7)
