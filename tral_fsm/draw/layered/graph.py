"""A machine as a layered graph: states stand in layers, and an arrow has a slot in each layer between its states.

Layers are numbered along the picture; "across" is the other direction. Even layers hold states, odd ones the labels of
passing arrows, so that labels do not meet states. All lengths are whole px.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

Edge = tuple[int, int]
GRID = 10
"""Grid of UMLet at zoom 10, px."""
_SHORTENINGS = 4
"""Number of times that each state moves towards its neighbours, so that arrows become short. Source: choice."""


@dataclass(frozen=True)
class Slot:
    """Room in a layer for a state's box, an arrow with its label, or a passing arrow."""

    layer: int
    before: int
    """Room across on the near side of a box's middle, or of an arrow's line."""
    after: int
    """Room across on the far side."""
    along: int
    """Room along."""
    state: int | None = None
    edge: int | None = None
    reach: int = 0
    """Largest distance between a box's middle and the ends of its arrows."""


@dataclass(frozen=True)
class Link:
    """Piece of an arrow from a slot of a layer to one of the next layer."""

    edge: int
    near: int
    far: int


@dataclass
class Graph:
    """Slots, and links between slots of neighbouring layers."""

    slots: list[Slot]
    links: list[Link]
    layers: int
    nearer: list[list[int]] = field(init=False)
    """Slot -> links that come from the layer before."""
    farther: list[list[int]] = field(init=False)
    """Slot -> links that lead to the layer after."""

    def __post_init__(self) -> None:
        self.nearer = [[] for _ in self.slots]
        self.farther = [[] for _ in self.slots]
        for index, link in enumerate(self.links):
            self.farther[link.near].append(index)
            self.nearer[link.far].append(index)


def orders(n: int, edges: Sequence[Edge], root: int) -> Iterator[tuple[int, ...]]:
    """Orders of the states in which most arrows may lead forward; the root comes first in each."""
    follow: list[list[int]] = [[] for _ in range(n)]
    for a, b in edges:
        follow[a].append(b)
    rest = [root, *(state for state in range(n) if state != root)]
    seen: dict[tuple[int, ...], None] = {}
    for found in (_breadth_first(follow, rest), _depth_first(follow, rest), rest, _greedy(n, edges, rest)):
        seen[tuple(found)] = None
    yield from seen


def _breadth_first(follow: list[list[int]], starts: list[int]) -> list[int]:
    found: dict[int, None] = {}
    for start in starts:
        front = deque([start])
        while front:
            here = front.popleft()
            if here not in found:
                found[here] = None
                front.extend(follow[here])
    return list(found)


def _depth_first(follow: list[list[int]], starts: list[int]) -> list[int]:
    """Reverse postorder: an arrow leads backward only if it closes a cycle."""
    done: list[int] = []
    seen: set[int] = set()
    for start in [starts[0], *reversed(starts[1:])]:
        stack = [(start, iter(follow[start]))] if start not in seen else []
        seen.add(start)
        while stack:
            here, ways = stack[-1]
            step = next((way for way in ways if way not in seen), None)
            if step is None:
                done.append(here)
                stack.pop()
            else:
                seen.add(step)
                stack.append((step, iter(follow[step])))
    back = done[::-1]
    return [starts[0], *(state for state in back if state != starts[0])]


def _greedy(n: int, edges: Sequence[Edge], rest: list[int]) -> list[int]:
    """Order that takes the state with the largest surplus of arrows out, again and again (Eades, Lin, Smyth 1993)."""
    left, found = rest[1:], [rest[0]]
    while left:
        inside = set(left)
        surplus = dict.fromkeys(left, 0)
        for a, b in edges:
            if a in inside and b in inside:
                surplus[a] += 1
                surplus[b] -= 1
        best = max(left, key=lambda state: surplus[state])
        found.append(best)
        left.remove(best)
    return found


def ranks(n: int, edges: Sequence[Edge], order: Sequence[int]) -> list[int]:
    """Rank of each state: arrows that lead forward in the order lead to a later rank, and are short."""
    place = {state: index for index, state in enumerate(order)}
    forward = [(a, b) if place[a] < place[b] else (b, a) for a, b in edges]
    rank = [0] * n
    for state in order:
        rank[state] = max((rank[a] + 1 for a, b in forward if b == state), default=0)
    for _ in range(_SHORTENINGS):
        for state in reversed(order[1:]):
            into = [rank[a] for a, b in forward if b == state]
            out = [rank[b] for a, b in forward if a == state]
            if out and len(out) > len(into):
                rank[state] = min(out) - 1
            elif into:
                rank[state] = max(into) + 1
    return rank


def layered(
    edges: Sequence[Edge], rank: Sequence[int], boxes: Sequence[Slot], labels: Sequence[tuple[int, int, int]]
) -> Graph:
    """The graph of slots.

    Args:
        edges: pairs of states, no two the same, none to itself.
        rank: layer of each state.
        boxes: slot of each state; their layers are set here.
        labels: room before, after and along of each edge's label.
    """
    slots = [Slot(2 * rank[i], b.before, b.after, b.along, state=i, reach=b.reach) for i, b in enumerate(boxes)]
    links = []
    for index, (a, b) in enumerate(edges):
        near, far = (a, b) if rank[a] < rank[b] else (b, a)
        # The label stands beside the state that the arrow leaves.
        labelled = 2 * rank[a] + (1 if near == a else -1)
        last = near
        for layer in range(2 * rank[near] + 1, 2 * rank[far]):
            before, after, along = labels[index] if layer == labelled else (GRID // 2, GRID // 2, 0)
            slots.append(Slot(layer, before, after, along, edge=index))
            links.append(Link(index, last, len(slots) - 1))
            last = len(slots) - 1
        links.append(Link(index, last, far))
    return Graph(slots, links, 2 * max(rank) + 1)


def round_up(length: int, step: int = GRID) -> int:
    """The next multiple of a step that is not less than a length."""
    return -(-length // step) * step
