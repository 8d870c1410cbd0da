"""Positions of the slots across, for which arrows run straight."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from tral_fsm.draw.layered.graph import GRID, Graph

_SWEEPS = 40
"""Number of sweeps that bring slots near to their neighbours. Source: choice."""
_STRAIGHTENING = 16
"""Number of sweeps after these that make arrows straight. Source: choice."""
_MAX_SLOTS = 1000
"""Number of slots from which on there are fewer sweeps, to limit the time. Source: choice."""
_PASSING, _ENDING = 4.0, 1.0
"""Weights of a bend between two passing pieces of an arrow, and at a box. Source: choice."""
_ALIGNMENTS = 3
"""Number of times that all arrows are aligned, since each makes room for others. Source: choice."""
_PLACED = 1.3
"""Factor on the weight of slots that were placed in the same sweep. Source: choice."""

Desired = tuple[float, float]
"""A place and its weight."""


def positions(graph: Graph, layers: Sequence[Sequence[int]]) -> list[float]:
    """Positions across of the middle of each box and of the line of each arrow, multiples of the grid.

    Args:
        graph: the graph.
        layers: slots of each layer in order.
    """
    position = [0.0] * len(graph.slots)
    for layer in layers:
        for one, two in itertools.pairwise(layer):
            position[two] = position[one] + gap(graph, one, two)
    finding, straightening = (max(2, min(n, n * _MAX_SLOTS // len(graph.slots))) for n in (_SWEEPS, _STRAIGHTENING))
    for sweep in range(finding + straightening):
        ends = link_ends(graph, position)
        straighten = sweep >= finding
        forth = sweep % 2 == 1
        for layer in layers if forth else reversed(layers):
            desired = [_desired(graph, slot, position, ends, forth) for slot in layer]
            gaps = [gap(graph, one, two) for one, two in itertools.pairwise(layer)]
            for slot, now in zip(layer, isotonic(desired, gaps, straighten), strict=True):
                position[slot] = now
    # Gaps are multiples of the grid, so rounding all alike keeps them.
    exact = [float(GRID * int(p // GRID + (p % GRID >= GRID / 2))) for p in position]
    _align(graph, layers, exact)
    return exact


def _align(graph: Graph, layers: Sequence[Sequence[int]], position: list[float]) -> None:
    """Remove bends of arrows where there is room: straight pieces move as one into line with the next."""
    chains: dict[int, list[int]] = {}
    for index, slot in enumerate(graph.slots):
        if slot.edge is not None:
            chains.setdefault(slot.edge, []).append(index)
    room = _Room(graph, layers, position)
    for _ in range(_ALIGNMENTS):
        for chain in chains.values():
            cut = 0
            for index in range(1, len(chain)):
                if position[chain[index]] == position[chain[index - 1]]:
                    continue
                end = index
                while end < len(chain) and position[chain[end]] == position[chain[index]]:
                    end += 1
                if not room.move(chain[cut:index], position[chain[index]]) and not room.move(
                    chain[index:end], position[chain[index - 1]]
                ):
                    cut = index


class _Room:
    """Moves slots between their neighbours of the same layer."""

    def __init__(self, graph: Graph, layers: Sequence[Sequence[int]], position: list[float]) -> None:
        self.graph, self.position = graph, position
        self.before = {two: one for layer in layers for one, two in itertools.pairwise(layer)}
        self.after = {one: two for two, one in self.before.items()}

    def move(self, slots: Sequence[int], to: float) -> bool:
        """Put slots of different layers there if they all have room; whether they had."""
        if not all(self._fits(slot, to) for slot in slots):
            return False
        for slot in slots:
            self.position[slot] = to
        return True

    def _fits(self, slot: int, to: float) -> bool:
        one, two = self.before.get(slot), self.after.get(slot)
        return (one is None or self.position[one] + gap(self.graph, one, slot) <= to) and (
            two is None or to + gap(self.graph, slot, two) <= self.position[two]
        )


def gap(graph: Graph, one: int, two: int) -> int:
    """Smallest distance of two neighbouring slots of a layer, px."""
    a, b = graph.slots[one], graph.slots[two]
    boxes = (a.state is not None) + (b.state is not None)
    return -(-(a.after + b.before + GRID * boxes) // GRID) * GRID


def _desired(
    graph: Graph, slot: int, position: Sequence[float], ends: dict[tuple[int, int], float], forth: bool
) -> tuple[list[Desired], float]:
    """Places at which the links of a slot would be straight, and its present place.

    Slots that were placed just before have a larger weight, so that a straight line grows.
    """
    desired = []
    for link, other, placed in [
        *((link, graph.links[link].near, forth) for link in graph.nearer[slot]),
        *((link, graph.links[link].far, not forth) for link in graph.farther[slot]),
    ]:
        passing = graph.slots[slot].state is None and graph.slots[other].state is None
        # The only arrow of a side should end in its middle.
        alone = len(graph.nearer[slot] if link in graph.nearer[slot] else graph.farther[slot]) == 1
        own = 0.0 if alone else ends[link, slot] - position[slot]
        weight = (_PASSING if passing else _ENDING) * (_PLACED if placed else 1.0)
        desired.append((ends[link, other] - own, weight))
    return desired, position[slot]


def isotonic(desired: Sequence[tuple[list[Desired], float]], gaps: Sequence[float], medians: bool) -> list[float]:
    """Places in order, at least `gaps` apart, as near as possible to the desired ones: isotonic regression.

    The pool adjacent violators algorithm: neighbours that would change their order become one block.

    Args:
        desired: for each place the desired ones, and the place itself if there are none.
        gaps: smallest distance of each place to the next.
        medians: minimize the sum of distances, not of their squares, which meets most of them exactly.

    Source: Ayer et al. 1955, An empirical distribution function for sampling with incomplete information.
    """
    shift = 0.0
    blocks: list[tuple[int, list[Desired], float]] = []
    shifts = []
    for index, (places, stay) in enumerate(desired):
        shifts.append(shift)
        own = [(place - shift, weight) for place, weight in places] or [(stay - shift, 1e-3)]
        count, value = 1, _middle(own, medians)
        while blocks and blocks[-1][2] >= value:
            before, theirs, _ = blocks.pop()
            count, own = count + before, theirs + own
            value = _middle(own, medians)
        blocks.append((count, own, value))
        shift += gaps[index] if index < len(gaps) else 0.0
    values = [value for count, _, value in blocks for _ in range(count)]
    return [value + shift for value, shift in zip(values, shifts, strict=True)]


def _middle(desired: list[Desired], median: bool) -> float:
    total = sum(weight for _, weight in desired)
    if not median:
        return sum(place * weight for place, weight in desired) / total
    half = 0.0
    for place, weight in sorted(desired):
        half += weight
        if half >= total / 2.0:
            return place
    raise AssertionError("no desired place")


def link_ends(graph: Graph, position: Sequence[float]) -> dict[tuple[int, int], float]:
    """(link, slot) -> end of the link at the slot: on an arrow's line, or in order along a box's side."""
    ends = {}
    for slot, what in enumerate(graph.slots):
        for side, links in (("near", graph.nearer[slot]), ("far", graph.farther[slot])):
            if what.state is None:
                ends.update({(link, slot): position[slot] for link in links})
                continue
            others = {link: getattr(graph.links[link], side) for link in links}
            ordered = sorted(links, key=lambda link, others=others: (position[others[link]], link))  # type: ignore[misc]
            low = position[slot] - what.reach
            step = min(2 * GRID, GRID * (2 * what.reach // max(1, len(links) - 1) // GRID))
            high = position[slot] + what.reach - step * (len(links) - 1)
            desired = [([(float(position[others[link]]), 1.0)], 0.0) for link in ordered]
            for index, (link, at) in enumerate(
                zip(ordered, isotonic(desired, [step] * (len(links) - 1), medians=True), strict=True)
            ):
                ends[link, slot] = min(max(at - index * step, low), high) + index * step
    return ends
