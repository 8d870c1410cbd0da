"""Order of the slots in each layer, with few crossings of arrows."""

from __future__ import annotations

from tral_fsm.draw.layered.graph import Graph

_SWEEPS = 12
"""Number of sweeps that sort the layers. Source: choice."""
_SWAPS = 8
"""Largest number of rounds of swaps; a round that swaps nothing is the last. Source: choice."""
_MAX_SLOTS = 1000
"""Number of slots from which on there are fewer sweeps, to limit the time. Source: choice."""


def untangled(graph: Graph) -> tuple[list[list[int]], int]:
    """Slots of each layer in their order across, and the number of crossings."""
    layers = _first(graph)
    best, fewest = layers, crossings(graph, layers)
    for sweep in range(max(2, min(_SWEEPS, _SWEEPS * _MAX_SLOTS // len(graph.slots)))):
        _sort_by_neighbours(graph, layers, down=sweep % 2 == 0)
        _swap(graph, layers)
        now = crossings(graph, layers)
        if now < fewest:
            best, fewest = [list(layer) for layer in layers], now
        if not fewest:
            break
    return best, fewest


def _first(graph: Graph) -> list[list[int]]:
    """Order in which a walk from the first layer meets the slots, so that neighbours start close together."""
    layers: list[list[int]] = [[] for _ in range(graph.layers)]
    seen: set[int] = set()
    for start in sorted(range(len(graph.slots)), key=lambda s: (graph.slots[s].layer, s)):
        stack = [start]
        while stack:
            here = stack.pop()
            if here not in seen:
                seen.add(here)
                layers[graph.slots[here].layer].append(here)
                stack += [graph.links[link].far for link in reversed(graph.farther[here])]
    return layers


def _neighbours(graph: Graph, slot: int, before: bool) -> list[int]:
    if before:
        return [graph.links[link].near for link in graph.nearer[slot]]
    return [graph.links[link].far for link in graph.farther[slot]]


def _sort_by_neighbours(graph: Graph, layers: list[list[int]], down: bool) -> None:
    """Sort the slots of each layer by the mean place of their neighbours."""
    for layer in range(1, graph.layers) if down else range(graph.layers - 2, -1, -1):
        place = {slot: i for i, slot in enumerate(layers[layer - 1 if down else layer + 1])}

        def mean(item: tuple[int, int], down: bool = down, place: dict[int, int] = place) -> float:
            index, slot = item
            places = [place[other] for other in _neighbours(graph, slot, before=down)]
            return sum(places) / len(places) if places else float(index)

        layers[layer] = [slot for _, slot in sorted(enumerate(layers[layer]), key=mean)]


def _pair_crossings(first: list[int], second: list[int]) -> int:
    """Number of crossings of the links of two neighbouring slots, from the places of their other ends."""
    return sum(a > b for a in first for b in second)


def _swap(graph: Graph, layers: list[list[int]]) -> None:
    """Swap neighbours in a layer wherever that reduces the crossings."""
    place = {slot: i for layer in layers for i, slot in enumerate(layer)}
    ends = {
        slot: [[place[other] for other in _neighbours(graph, slot, side)] for side in (True, False)] for slot in place
    }
    for _ in range(_SWAPS):
        moved = False
        for layer in layers:
            for i in range(len(layer) - 1):
                a, b = layer[i], layer[i + 1]
                now = sum(_pair_crossings(x, y) for x, y in zip(ends[a], ends[b], strict=True))
                then = sum(_pair_crossings(y, x) for x, y in zip(ends[a], ends[b], strict=True))
                if then < now:
                    layer[i], layer[i + 1] = b, a
                    place[a], place[b] = i + 1, i
                    for other in {*_neighbours(graph, a, True), *_neighbours(graph, b, True)}:
                        ends[other][1] = [place[s] for s in _neighbours(graph, other, False)]
                    for other in {*_neighbours(graph, a, False), *_neighbours(graph, b, False)}:
                        ends[other][0] = [place[s] for s in _neighbours(graph, other, True)]
                    moved = True
        if not moved:
            break


def crossings(graph: Graph, layers: list[list[int]]) -> int:
    """Number of crossings of links, over all pairs of layers."""
    place = {slot: i for layer in layers for i, slot in enumerate(layer)}
    total = 0
    for layer in layers:
        ends: list[int] = []
        for slot in layer:
            own = [place[other] for other in _neighbours(graph, slot, before=False)]
            total += sum(end > mine for end in ends for mine in own)
            ends += own
    return total
