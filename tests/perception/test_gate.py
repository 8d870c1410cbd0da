import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.perception.gate import nearest_gate_and_marker


def row(*markers):
    """One row of markers: id, x, y, heading."""
    ids, x, y, heading = np.array(markers, float).reshape(-1, 4).T
    return nearest_gate_and_marker(
        ids[None].astype(np.int64), x[None], y[None], heading[None], np.ones((1, len(ids)), bool)
    )


def gate(number, x, y, axis, width=1.0):
    left = np.array([-np.sin(axis), np.cos(axis)]) * width / 2
    return (2 * number, x + left[0], y + left[1], axis), (2 * number + 1, x - left[0], y - left[1], axis)


@given(st.integers(0, 19), st.floats(1, 6), st.floats(-2, 2), st.floats(-0.8, 0.8), st.floats(0.5, 1.4))
def test_a_gate_is_its_middle_and_its_axis(number, x, y, axis, width):
    seen = row(*gate(number, x, y, axis, width))
    assert seen.gate_id[0] == number
    assert (seen.gate_x[0], seen.gate_y[0], seen.gate_heading[0]) == pytest.approx((x, y, axis), abs=1e-9)


def test_the_nearest_of_several_gates_counts():
    assert row(*gate(5, 4.0, 0.0, 0.0), *gate(9, 2.0, 0.1, 0.0), *gate(0, 6.0, 0.0, 0.0)).gate_id[0] == 9


def test_the_order_of_the_markers_does_not_matter():
    left, right = gate(3, 2.0, 0.2, 0.1)
    assert row(left, right).gate_heading[0] == row(right, left).gate_heading[0]


def test_one_marker_alone_is_no_gate():
    seen = row((6, 2.0, 0.5, 0.0))
    assert not seen.gate_seen[0]
    assert (seen.gate_x[0], seen.gate_y[0], seen.gate_heading[0]) == (0.0, 0.0, 0.0)


def test_neighbours_of_different_gates_are_no_gate():
    assert not row((1, 2.0, 0.5, 0.0), (2, 2.0, -0.5, 0.0)).gate_seen[0]


def test_a_pair_with_its_left_marker_on_the_right_is_no_gate():
    assert not row((4, 2.0, -0.5, 0.0), (5, 2.0, 0.5, 0.0)).gate_seen[0]


def test_turn_markers_make_no_gate():
    assert not row((40, 2.0, 0.5, 0.0), (41, 2.0, -0.5, 0.0)).gate_seen[0]


def test_the_nearest_marker_counts_whether_or_not_it_belongs_to_a_gate():
    seen = row(*gate(0, 2.0, 0.1, 0.0), (42, 3.0, 0.0, 0.3))
    assert seen.marker_id[0] == 1
    assert row((42, 1.0, 0.2, 0.3), *gate(0, 2.0, 0.1, 0.0)).marker_heading[0] == 0.3


def test_of_two_markers_of_one_id_the_nearer_counts():
    assert row((40, 5.0, 0.0, 0.0), (40, 3.0, 0.1, 0.2)).marker_x[0] == 3.0


def test_nothing_seen_is_said_as_the_interface_says_it():
    seen = row()
    assert seen.gate_id.tolist() == seen.marker_id.tolist() == [-1.0]
    assert not seen.marker_seen[0]
    assert seen.marker_x[0] == seen.marker_heading[0] == 0.0


def test_places_that_are_not_valid_do_not_count():
    ids, zeros = np.array([[0, 1]]), np.zeros((1, 2))
    assert not nearest_gate_and_marker(ids, zeros + 1, zeros, zeros, np.zeros((1, 2), bool)).marker_seen[0]


def test_a_row_has_the_same_bits_in_any_batch():
    rng = np.random.default_rng(1)
    ids = rng.integers(0, 43, (50, 8))
    x, y, heading = rng.uniform(0.5, 6, (50, 8)), rng.uniform(-2, 2, (50, 8)), rng.uniform(-1, 1, (50, 8))
    valid = rng.random((50, 8)) < 0.7
    together = nearest_gate_and_marker(ids, x, y, heading, valid)
    assert together.gate_seen.any()
    for i in range(50):
        one = slice(i, i + 1)
        alone = nearest_gate_and_marker(ids[one], x[one], y[one], heading[one], valid[one])
        for name, values in vars(together).items():
            assert getattr(alone, name)[0] == values[i], name
