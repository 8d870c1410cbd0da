"""Where the states of a diagram stand, and through which points its arrows run: in layers below the root."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from tral_fsm.definition import MachineDefinition

_ACROSS, _DOWN = 320.0, 240.0
"""Room between two states, px: an arrow's text stands there."""
_FIRST = (140.0, 60.0)
"""Corner of the drawing, px."""
_WIDEST = 5
"""States in a layer."""
_APART = 20.0
"""Between arrows of the same two states, px."""

Point = tuple[float, float]


@dataclass(frozen=True)
class Box:
    """A rectangle in pixels; y points down."""

    x: float
    y: float
    width: float
    height: float

    @property
    def middle(self) -> Point:
        """Its centre."""
        return self.x + self.width / 2.0, self.y + self.height / 2.0


def boxes(machine: MachineDefinition, sizes: Sequence[tuple[float, float]]) -> list[Box]:
    """A box for each state.

    Args:
        machine: the definition.
        sizes: width and height of each state, px.

    Returns:
        Boxes in the order of the states; no two touch.
    """
    placed: dict[int, Box] = {}
    y = _FIRST[1]
    for row in _rows(machine):
        x = _FIRST[0]
        for index in row:
            width, height = sizes[index]
            placed[index] = Box(x, y, width, height)
            x += width + _ACROSS
        y += max(sizes[index][1] for index in row) + _DOWN
    return [placed[index] for index in range(len(sizes))]


def arrows(placed: Sequence[Box], ends: Sequence[tuple[int, int]]) -> list[list[Point]]:
    """Points of each arrow, from outline to outline; arrows of the same two states run beside each other.

    Args:
        placed: the states.
        ends: index of source and target of each arrow.
    """
    together = Counter(frozenset(pair) for pair in ends)
    seen: Counter[frozenset[int]] = Counter()
    found = []
    for source, target in ends:
        pair = frozenset((source, target))
        place = seen[pair] - (together[pair] - 1) / 2.0
        seen[pair] += 1
        if source == target:
            found.append(_loop(placed[source], seen[pair]))
        else:
            # Sideways as seen from the lower index, so that both directions share the lanes.
            found.append(_straight(placed[source], placed[target], _APART * place * (1 if source < target else -1)))
    return found


def _rows(machine: MachineDefinition) -> list[list[int]]:
    """Indices of the states: root first, then what one transition leads to, then two; long rows are broken."""
    index = {state.id: number for number, state in enumerate(machine.states)}
    follows: dict[int, list[int]] = {number: [] for number in index.values()}
    for transition in machine.transitions:
        follows[index[transition.source]].append(index[transition.target])
    layers, seen = [[index[machine.root]]], {index[machine.root]}
    while layers[-1]:
        layer = list(dict.fromkeys(there for here in layers[-1] for there in follows[here] if there not in seen))
        seen.update(layer)
        layers.append(layer)
    layers.append([number for number in follows if number not in seen])
    return [layer[at : at + _WIDEST] for layer in layers for at in range(0, len(layer), _WIDEST)]


def _straight(source: Box, target: Box, aside: float) -> list[Point]:
    """A line between the middles, `aside` to its right, cut off at the outlines."""
    (x, y), (u, v) = source.middle, target.middle
    length = math.hypot(u - x, v - y)
    right = (-(v - y) / length, (u - x) / length)
    most = min(source.width, source.height, target.width, target.height) / 2.0 - 12.0
    shift = max(-most, min(most, aside))
    a = (x + shift * right[0], y + shift * right[1])
    b = (u + shift * right[0], v + shift * right[1])
    return [_leaves(source, a, b), _leaves(target, b, a)]


def _leaves(box: Box, inside: Point, towards: Point) -> Point:
    """Where a line from a point inside a box crosses its outline."""
    dx, dy = towards[0] - inside[0], towards[1] - inside[1]
    shares = []
    if dx:
        shares.append(((box.x + box.width if dx > 0 else box.x) - inside[0]) / dx)
    if dy:
        shares.append(((box.y + box.height if dy > 0 else box.y) - inside[1]) / dy)
    share = min(shares)
    return inside[0] + share * dx, inside[1] + share * dy


def _loop(box: Box, count: int) -> list[Point]:
    """From the right side round the lower corner to the bottom."""
    x, y = box.x + box.width, box.y + box.height
    out = 20.0 + 12.0 * count
    near = min(10.0 + 8.0 * count, min(box.width, box.height) - 10.0)
    return [(x, y - near), (x + out, y - near), (x + out, y + out), (x - near, y + out), (x - near, y)]
