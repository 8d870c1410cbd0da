"""A law gives a car alone what it gives many, to the last bit and to the sign of a zero."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tral_env.arrays import (
    ALL,
    ALONE,
    as_rows,
    columns,
    everyone,
    floor,
    is_any,
    largest,
    maximum,
    minimum,
    negation,
    pick,
    rint,
    spread,
    sqrt,
    square,
    where,
)

numbers = st.floats(allow_nan=False) | st.sampled_from([0.0, -0.0])


@given(numbers, numbers)
def test_two_numbers_have_the_extremes_of_two_arrays(a: float, b: float) -> None:
    for ours, numpys in ((minimum, np.minimum), (maximum, np.maximum)):
        alone, among = ours(a, b), numpys(np.array([1.0, a, 2.0]), np.array([3.0, b, 1.0]))
        assert np.array(alone).tobytes() == among[1].tobytes()
        assert ours(np.array([a]), np.array([b])).tobytes() == among[1:2].tobytes()


@given(st.floats(-1e150, 1e150) | st.sampled_from([-0.0, 0.5, -0.5, 2.5]))
def test_a_number_is_rounded_as_arrays_are(value: float) -> None:
    among = np.array([1.5, value, -7.25])
    for ours, numpys in ((floor, np.floor), (rint, np.rint), (sqrt, np.sqrt), (square, np.square)):
        given = abs(value) if ours is sqrt else value
        alone = ours(given)
        assert type(alone) is float
        assert np.array(alone).tobytes() == numpys(np.abs(among) if ours is sqrt else among)[1].tobytes()
        assert ours(np.array([given])).tobytes() == np.array([alone]).tobytes()
    assert largest(value) == value
    assert largest(np.array([1, 3, 2])) == 3


def test_a_bool_chooses_one_of_two_and_flags_choose_by_row() -> None:
    assert [where(True, 1.0, 2.0), where(False, 1.0, 2.0)] == [1.0, 2.0]
    assert where(np.array([True, False]), 1.0, 2.0).tolist() == [1.0, 2.0]
    assert negation(True) is False
    assert negation(np.array([True, False])).tolist() == [False, True]
    assert is_any(True)
    assert not is_any(np.zeros(3, bool))


def test_one_car_is_alone_and_several_are_all() -> None:
    assert everyone(1) is ALONE
    assert everyone(2) is ALL


def test_a_car_alone_is_picked_as_a_number_and_others_as_arrays() -> None:
    values = np.array([[1.0, 2.0], [3.0, 4.0]])
    alone = pick(values[:1, 0], ALONE)
    assert (alone, type(alone)) == (1.0, float)
    assert pick(values[:, 0], ALL).tolist() == [1.0, 3.0]
    assert pick(values[:, 0], np.array([1])).tolist() == [3.0]
    assert pick(7.0, ALL) == pick(7.0, np.array([1])) == 7.0
    assert type(pick(np.float64(7.0), ALONE)) is float
    assert columns(values[:1], ALONE) == [1.0, 2.0]
    assert [column.tolist() for column in columns(values, ALL)] == [[1.0, 3.0], [2.0, 4.0]]
    assert [column.tolist() for column in columns(values, np.array([1]))] == [[3.0], [4.0]]


def test_numbers_become_rows_and_rows_stand_beside_columns() -> None:
    assert as_rows(2.0).tolist() == [2.0]
    assert as_rows(np.array([1.0, 2.0])).tolist() == [1.0, 2.0]
    assert spread(np.zeros(3)).shape == (3, 1)
    assert spread(2.0) == 2.0
