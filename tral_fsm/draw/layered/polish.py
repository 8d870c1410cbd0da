"""Last changes to positions across: bends that vanish when other slots make room."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from tral_fsm.draw.layered.graph import GRID, Graph
from tral_fsm.draw.layered.positions import gap, link_ends

_PASSES = 4
"""Largest number of passes over all bends; a pass that changes nothing is the last. Source: choice."""


def polished(graph: Graph, layers: Sequence[Sequence[int]], position: Sequence[float]) -> list[float]:
    """Positions with fewer bends: each bent link tries to become straight, and pushes its neighbours away.

    A move stays if it makes the bends fewer, or shorter at the same number. Positions stay multiples of the grid.
    """
    before = {two: one for layer in layers for one, two in itertools.pairwise(layer)}
    after = {one: two for two, one in before.items()}
    best = list(position)
    cost, ends = _cost(graph, best)
    for _ in range(_PASSES):
        start = cost
        for index, link in enumerate(graph.links):
            for slot, other in ((link.near, link.far), (link.far, link.near)):
                shift = ends[index, other] - ends[index, slot]
                if not shift:
                    break
                tried = list(best)
                for moved in _run(graph, slot, best):
                    _push(graph, tried, moved, tried[moved] + shift, before, after)
                now, moved_ends = _cost(graph, tried)
                if now < cost:
                    best, cost, ends = tried, now, moved_ends
        if cost == start:
            break
    return best


def _cost(graph: Graph, position: Sequence[float]) -> tuple[tuple[int, float], dict[tuple[int, int], float]]:
    """Number and total length of the bends, and the ends of the links."""
    ends = {key: float(round(end / GRID) * GRID) for key, end in link_ends(graph, position).items()}
    offs = [abs(ends[i, link.near] - ends[i, link.far]) for i, link in enumerate(graph.links)]
    return (sum(off > 0 for off in offs), sum(offs, 0.0)), ends


def _run(graph: Graph, slot: int, position: Sequence[float]) -> list[int]:
    """Slots of the straight piece of an arrow around a slot; a box alone."""
    run = [slot]
    if graph.slots[slot].edge is None:
        return run
    for links, end in ((graph.nearer, "near"), (graph.farther, "far")):
        here = slot
        while graph.slots[here].edge is not None:
            here = getattr(graph.links[links[here][0]], end)
            if graph.slots[here].edge is None or position[here] != position[slot]:
                break
            run.append(here)
    return run


def _push(
    graph: Graph, position: list[float], slot: int, to: float, before: dict[int, int], after: dict[int, int]
) -> None:
    """Move a slot, and push away the slots of its layer that are in the way."""
    position[slot] = to
    here = slot
    while (two := after.get(here)) is not None and position[two] < position[here] + gap(graph, here, two):
        position[two] = position[here] + gap(graph, here, two)
        here = two
    here = slot
    while (one := before.get(here)) is not None and position[one] > position[here] - gap(graph, one, here):
        position[one] = position[here] - gap(graph, one, here)
        here = one
