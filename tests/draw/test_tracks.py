"""Pieces of arrows that turn between two layers do not lie on each other."""

from hypothesis import given
from hypothesis import strategies as st

from tral_fsm.draw.layered.tracks import Turn, tracks


def crossings(turns: list[Turn], found: list[int | None]) -> int:
    total = 0
    for i, (a, b) in enumerate(turns):
        for j, (c, d) in enumerate(turns):
            if i != j and found[i] is not None and found[j] is not None:
                low, high = min(a, b), max(a, b)
                total += low < (c if found[i] < found[j] else d) < high
    return total


def test_a_straight_piece_needs_no_track() -> None:
    assert tracks([(10, 10), (20, 40)]) == [None, 0]


def test_pieces_apart_share_a_track() -> None:
    assert tracks([(0, 10), (20, 30)]) == [0, 0]


def test_of_two_that_lead_down_the_lower_turns_first_and_none_cross() -> None:
    turns = [(0, 30), (10, 40)]
    assert tracks(turns) == [1, 0]
    assert crossings(turns, tracks(turns)) == 0


def test_of_two_that_lead_up_the_upper_turns_first_and_none_cross() -> None:
    turns = [(30, 0), (40, 10)]
    assert tracks(turns) == [0, 1]
    assert crossings(turns, tracks(turns)) == 0


def test_an_arrow_does_not_end_on_the_beginning_of_another() -> None:
    assert tracks([(0, 20), (20, 50)]) == [1, 0]
    assert tracks([(20, 50), (0, 20)]) == [0, 1]


@given(st.integers(1, 8).flatmap(lambda n: st.tuples(st.permutations(range(n)), st.permutations(range(n)))))
def test_pieces_that_meet_have_tracks_of_their_own(ends: tuple[list[int], list[int]]) -> None:
    turns = list(zip(*ends, strict=True))
    found = tracks(turns)
    for i, one in enumerate(turns):
        for j, two in enumerate(turns[:i]):
            if found[i] is not None and found[i] == found[j]:
                assert max(min(one), min(two)) > min(max(one), max(two))
