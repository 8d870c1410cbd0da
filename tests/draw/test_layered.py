"""The steps of the layered layout, one by one: layers, order in a layer, bends."""

from __future__ import annotations

import pytest

from tral_fsm.draw.layered.graph import Edge, Graph, Link, Slot, ranks
from tral_fsm.draw.layered.order import crossings, untangled
from tral_fsm.draw.layered.polish import polished
from tral_fsm.draw.layered.positions import link_ends


def box(layer: int, state: int) -> Slot:
    """A box of 60 px across, whose arrows may end within 20 px of its middle."""
    return Slot(layer, 30, 30, 100, state=state, reach=20)


def graph(layers: list[list[int]], edges: list[Edge]) -> Graph:
    """A graph of states alone; slot k is state k."""
    slots = {state: box(layer, state) for layer, states in enumerate(layers) for state in states}
    links = [Link(index, near, far) for index, (near, far) in enumerate(edges)]
    return Graph([slots[k] for k in sorted(slots)], links, len(layers))


@pytest.mark.parametrize(
    ("edges", "order", "found"),
    [
        ([(0, 1), (1, 2), (2, 3), (0, 3)], (0, 1, 2, 3), [0, 1, 2, 3]),  # the longest way counts
        ([(0, 1), (1, 2), (3, 2)], (0, 1, 3, 2), [0, 1, 2, 1]),  # the arrow from 3 is as short as it can be
        ([(0, 1), (1, 0)], (0, 1), [0, 1]),  # an arrow back does not count as one forth
        ([], (0, 1), [0, 0]),
    ],
)
def test_a_state_stands_behind_those_that_lead_to_it(
    edges: list[Edge], order: tuple[int, ...], found: list[int]
) -> None:
    assert ranks(len(order), edges, order) == found


def test_two_arrows_that_cross_are_untangled() -> None:
    crossed = graph([[0, 1], [2, 3]], [(0, 3), (1, 2)])
    assert crossings(crossed, [[0, 1], [2, 3]]) == 1
    layers, left = untangled(crossed)
    assert left == crossings(crossed, layers) == 0
    assert [sorted(layer) for layer in layers] == [[0, 1], [2, 3]]


def test_where_two_arrows_must_cross_the_crossing_is_counted() -> None:
    every = graph([[0, 1], [2, 3]], [(0, 2), (0, 3), (1, 2), (1, 3)])
    assert untangled(every)[1] == 1


def test_a_bend_vanishes_where_there_is_room() -> None:
    bent = graph([[0], [1]], [(0, 1)])
    for position, off in (([0.0, 60.0], 20.0), (polished(bent, [[0], [1]], [0.0, 60.0]), 0.0)):
        ends = link_ends(bent, position)
        assert ends[0, 1] - ends[0, 0] == off


def test_a_straight_arrow_stays_and_so_do_boxes_without_one() -> None:
    straight = graph([[0, 2], [1]], [(0, 1)])
    assert polished(straight, [[0, 2], [1]], [0.0, 0.0, 100.0]) == [0.0, 0.0, 100.0]
