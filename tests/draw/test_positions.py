"""Places in order, as near to what is wished as the gaps allow."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_fsm.draw.layered.positions import isotonic


def test_desired_places_that_keep_the_gaps_come_true() -> None:
    assert isotonic([([(5.0, 1.0)], 0.0), ([(40.0, 1.0)], 0.0)], [20.0], medians=False) == [5.0, 40.0]


def test_two_that_want_the_same_place_share_the_way() -> None:
    assert isotonic([([(50.0, 1.0)], 0.0), ([(50.0, 1.0)], 0.0)], [20.0], medians=False) == [40.0, 60.0]


def test_what_counts_more_moves_less() -> None:
    assert isotonic([([(50.0, 3.0)], 0.0), ([(50.0, 1.0)], 0.0)], [20.0], medians=False) == [45.0, 65.0]


def test_with_medians_the_heavier_wish_comes_true_exactly() -> None:
    assert isotonic([([(10.0, 1.0), (30.0, 2.0)], 0.0)], [], medians=True) == [30.0]


def test_a_slot_without_a_desired_place_stays() -> None:
    assert isotonic([([], 7.0)], [], medians=False) == [7.0]


WISHES = st.lists(st.tuples(st.floats(-500, 500), st.floats(0.5, 8)), max_size=4)


@given(st.lists(st.tuples(WISHES, st.floats(-500, 500)), min_size=1, max_size=8), st.booleans(), st.data())
def test_gaps_are_kept(desired: list, medians: bool, data: st.DataObject) -> None:
    gaps = data.draw(st.lists(st.sampled_from([0.0, 10.0, 40.0]), min_size=len(desired) - 1, max_size=len(desired) - 1))
    found = isotonic(desired, gaps, medians)
    for one, two, gap in zip(found, found[1:], gaps, strict=False):
        assert two - one >= gap - 1e-6
    if len(desired) == 1 and desired[0][0]:
        assert min(p for p, _ in desired[0][0]) <= found[0] + 1e-9 <= max(p for p, _ in desired[0][0]) + 1e-6
    assert found == pytest.approx(isotonic(desired, gaps, medians), abs=0.0)
