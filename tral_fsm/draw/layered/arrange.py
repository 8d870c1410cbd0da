"""Layered layout of a machine: the places of its boxes, arrows and labels.

A layered layout (Sugiyama, Tagawa, Toda 1981) with right-angled arrows, in four steps: states to layers (`graph`), the
order in each layer (`order`), positions across (`positions`, `polish`), points (`tracks`, `routing`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import islice

from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.draw.layered.content import Content, LabelSize, StateSize
from tral_fsm.draw.layered.graph import GRID, Graph, orders, ranks, round_up
from tral_fsm.draw.layered.order import untangled
from tral_fsm.draw.layered.polish import polished
from tral_fsm.draw.layered.positions import link_ends, positions
from tral_fsm.draw.layered.routing import MARGIN, Router
from tral_fsm.draw.layered.shapes import Arrangement, Direction

_PAGE = (1400.0, 900.0)
"""Width and height in which a picture should fit, px. Source: choice."""
_MAX_PARTS = 150
"""Number of states and arrows beyond which one order alone is tried, to limit the time. Source: choice."""
_CROSSING = 0.01
"""Cost of a crossing, in parts of a page by which the picture would be larger. Source: choice."""


def arrange(
    machine: MachineDefinition,
    *,
    state_size: StateSize,
    label_size: LabelSize,
    direction: Direction | None = None,
    bundled: bool = True,
) -> Arrangement:
    """Arrange a machine in layers, without its inner machines.

    Args:
        machine: a definition that `check` accepts.
        state_size: function for the smallest width and height of a state's box, px.
        label_size: function for the width and height of an arrow's text, px, from transitions and ordinals ("2. ").
        direction: direction of most arrows; None: the one with the better picture.
        bundled: one arrow for all transitions from one state to another; else an arrow for each.

    Returns:
        The arrangement, always the same for the same machine.
    """
    content = Content(machine, bundled, state_size, label_size)
    ways: tuple[Direction, ...] = ("right", "down") if direction is None else (direction,)
    n = len(machine.states)
    best: tuple[float, Callable[[bool], Arrangement]] | None = None
    for order in islice(orders(n, content.edges, content.root), None if n + len(content.edges) <= _MAX_PARTS else 1):
        rank = ranks(n, content.edges, order)
        layers, crossed = untangled(content.graph(rank, ways[0]))  # it does not depend on sizes
        for way in ways:
            draw = partial(_placed, content, content.graph(rank, way), layers, way)
            found = draw(False)
            cost = max(found.width / _PAGE[0], found.height / _PAGE[1]) + _CROSSING * crossed
            if best is None or cost < best[0]:
                best = cost, draw
    assert best is not None
    return best[1](n + len(content.edges) <= _MAX_PARTS)


def _placed(
    content: Content, graph: Graph, layers: Sequence[Sequence[int]], way: Direction, polish: bool
) -> Arrangement:
    """Arrangement of a layered graph with this order of slots."""
    found = positions(graph, layers)
    if polish:
        found = polished(graph, layers, found)
    low = min(p - slot.before for p, slot in zip(found, graph.slots, strict=True))
    shift = round_up(MARGIN - int(low))
    ends = {key: round(end / GRID) * GRID + shift for key, end in link_ends(graph, found).items()}
    return Router(content, graph, way, [int(p) + shift for p in found], ends).arrangement()
