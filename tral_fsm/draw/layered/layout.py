"""Where everything of a drawn machine stands: boxes, arrows, labels. Pure data, the same for each way to draw it.

A layered layout (Sugiyama, Tagawa, Toda 1981) with right-angled arrows. All numbers are whole px; x to the right, y
down. Boxes, and what arrows end and turn at, are multiples of 10, as UMLet's grid is at zoom 10.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Literal

from tral_fsm.definition.machine import MachineDefinition, StateSpec, TransitionSpec
from tral_fsm.draw import text
from tral_fsm.draw.layered.graph import GRID, Edge, Graph, Slot, layered, orders, ranks
from tral_fsm.draw.layered.order import untangled
from tral_fsm.draw.layered.place import link_ends, places
from tral_fsm.draw.layered.polish import polished
from tral_fsm.draw.layered.tracks import tracks

Point = tuple[int, int]
Direction = Literal["right", "down"]
Size = tuple[int, int]
"""Width and height, px."""

_MARGIN = 20
_ROOT = 30
"""Length of the arrow that points to the root."""
_LOOP = 20
"""How far an arrow from a state to itself leads away from it."""
_PAGE = (1400.0, 900.0)
"""What a picture should fit in, px. Source: choice."""
_MANY = 150
"""With more states and arrows one order is tried, not several, so that the time stays bearable. Source: choice."""
_CROSSING = 0.01
"""A crossing is as bad as a picture that is larger by so much of a page. Source: choice."""


@dataclass(frozen=True)
class Rect:
    """A rectangle; x, y is its upper left corner."""

    x: int
    y: int
    w: int
    h: int

    def overlaps(self, other: Rect) -> bool:
        """Whether the two have area in common."""
        return (
            self.x < other.x + other.w
            and other.x < self.x + self.w
            and self.y < other.y + other.h
            and other.y < self.y + self.h
        )


@dataclass(frozen=True)
class Route:
    """The arrow of all transitions from one state to another."""

    transitions: tuple[int, ...]
    """Their places in `machine.transitions`, in order; one alone unless they are bundled."""
    points: tuple[Point, ...]
    """From the outline of the box that is left to that of the box that is entered."""
    label: Rect
    """Room for its text; nothing else is there."""


@dataclass(frozen=True)
class Layout:
    """A machine, laid out."""

    width: int
    height: int
    direction: Direction
    """Where most arrows lead."""
    boxes: tuple[Rect, ...]
    """Of each state, in the machine's order."""
    routes: tuple[Route, ...]
    root: tuple[Point, Point]
    """The arrow without a beginning that points to the root."""


def drawn_state(state: StateSpec) -> Size:
    """Room that the picture's text of a state takes."""
    lines = text.state_lines(state)
    width, height = text.size(lines)
    return max(width, text.width(text.state_name(state), bold=True)) + 20, height + text.LINE + 16


def drawn_label(transitions: Sequence[TransitionSpec], places: Sequence[str]) -> Size:
    """Room that the picture's text of bundled transitions takes."""
    return text.size(
        [line for t, place in zip(transitions, places, strict=True) for line in text.transition_lines(t, place)]
    )


def turn_places(machine: MachineDefinition) -> list[str]:
    """When each transition is asked among those of its state: "2. "; empty if it is the only one."""
    leaving: dict[int | str, list[int]] = {}
    for index, transition in enumerate(machine.transitions):
        leaving.setdefault(transition.source, []).append(index)
    found = [""] * len(machine.transitions)
    for indices in leaving.values():
        for turn, index in enumerate(indices, 1):
            found[index] = f"{turn}. " if len(indices) > 1 else ""
    return found


def layout(
    machine: MachineDefinition,
    *,
    direction: Direction | None = None,
    bundled: bool = True,
    state_size: Callable[[StateSpec], Size] = drawn_state,
    label_size: Callable[[Sequence[TransitionSpec], Sequence[str]], Size] = drawn_label,
) -> Layout:
    """Lay out a machine; its inner machines are not looked at.

    Args:
        machine: a definition whose ids and ends are right (`check`).
        direction: where most arrows lead; None: as the picture comes out better.
        bundled: one arrow for all transitions from one state to another; else one for each.
        state_size: least width and height of a state's box, px.
        label_size: width and height of an arrow's text, px, from its transitions and their places among those that
            leave the state ("2. ").

    Returns:
        The layout: always the same for the same machine.
    """
    plan = _Plan(machine, bundled, state_size, label_size)
    ways: tuple[Direction, ...] = ("right", "down") if direction is None else (direction,)
    n = len(machine.states)
    best: tuple[float, Callable[[bool], Layout]] | None = None
    for order in islice(orders(n, plan.edges, plan.root), None if n + len(plan.edges) <= _MANY else 1):
        rank = ranks(n, plan.edges, order)
        layers, crossed = untangled(plan.graph(rank, ways[0]))  # sizes make no difference to it
        for way in ways:
            draw = partial(_placed, plan, plan.graph(rank, way), layers, way)
            found = draw(False)
            cost = max(found.width / _PAGE[0], found.height / _PAGE[1]) + _CROSSING * crossed
            if best is None or cost < best[0]:
                best = cost, draw
    assert best is not None
    return best[1](n + len(plan.edges) <= _MANY)


class _Plan:
    """What is to be drawn: sizes, edges, loops."""

    def __init__(
        self,
        machine: MachineDefinition,
        bundled: bool,
        state_size: Callable[[StateSpec], Size],
        label_size: Callable[[Sequence[TransitionSpec], Sequence[str]], Size],
    ) -> None:
        index = {state.id: i for i, state in enumerate(machine.states)}
        self.root = index[machine.root]
        bundles: dict[tuple[int, int, int], list[int]] = {}
        for i, t in enumerate(machine.transitions):
            bundles.setdefault((index[t.source], index[t.target], 0 if bundled else i), []).append(i)
        turn = turn_places(machine)
        sizes = {
            key: label_size([machine.transitions[i] for i in found], [turn[i] for i in found])
            for key, found in bundles.items()
        }
        through = [key for key in bundles if key[0] != key[1]]
        self.edges: list[Edge] = [(a, b) for a, b, _ in through]
        self.edge_transitions = [tuple(bundles[key]) for key in through]
        self.labels = [sizes[key] for key in through]
        self.loops: dict[int, list[tuple[tuple[int, ...], Size]]] = {}
        for key in bundles:
            if key[0] == key[1]:
                self.loops.setdefault(key[0], []).append((tuple(bundles[key]), sizes[key]))
        self.sizes = [state_size(state) for state in machine.states]

    def box(self, state: int, rank: Sequence[int], way: Direction) -> tuple[int, int]:
        """Extent of a state's box along and across: room for its text and for its arrows."""
        w, h = self.sizes[state]
        along, across = (w, h) if way == "right" else (h, w)
        sides = [rank[b] > rank[a] if a == state else rank[a] > rank[b] for a, b in self.edges if state in (a, b)]
        arrows = max(sides.count(True), sides.count(False))
        loops = len(self.loops.get(state, ()))
        return _up(max(along, 4 * GRID * loops)), _up(max(across, 2 * GRID * (arrows + 1)), 2 * GRID)

    def graph(self, rank: Sequence[int], way: Direction) -> Graph:
        """The slots for a way to draw it."""
        boxes = []
        for state in range(len(self.sizes)):
            along, across = self.box(state, rank, way)
            beside, further = self._loop_room(state, way)
            boxes.append(Slot(0, across // 2, across // 2 + beside, max(along, further), reach=across // 2 - GRID))
        labels = []
        for w, h in self.labels:
            labels.append(
                (_up(h + 4), GRID // 2, _up(w + GRID)) if way == "right" else (5, _up(w + 10) - 5, _up(h + 4))
            )
        return layered(self.edges, rank, boxes, labels)

    def _loop_room(self, state: int, way: Direction) -> Size:
        """Room across, beyond the box, and along that a state's arrows to itself take."""
        loops = self.loops.get(state)
        if not loops:
            return 0, 0
        if way == "right":
            return _LOOP + _up(sum(h + 4 for _, (_, h) in loops)), _up(max(w for _, (w, _) in loops) + 2 * GRID)
        return _LOOP + _up(max(w for _, (w, _) in loops) + GRID), _up(sum(h + 8 for _, (_, h) in loops))


def _up(length: int, step: int = GRID) -> int:
    return -(-length // step) * step


def _placed(plan: _Plan, graph: Graph, layers: Sequence[Sequence[int]], way: Direction, polish: bool) -> Layout:
    """A layout of a layered graph whose slots stand in this order."""
    found = places(graph, layers)
    if polish:
        found = polished(graph, layers, found)
    low = min(p - slot.before for p, slot in zip(found, graph.slots, strict=True))
    shift = _up(_MARGIN - int(low))
    ends = {key: round(end / GRID) * GRID + shift for key, end in link_ends(graph, found).items()}
    return _Drawing(plan, graph, way, [int(p) + shift for p in found], ends).layout()


class _Drawing:
    """Turns places across and layers along into points."""

    def __init__(
        self, plan: _Plan, graph: Graph, way: Direction, position: list[int], ends: dict[tuple[int, int], int]
    ) -> None:
        self.plan, self.graph, self.way, self.position, self.ends = plan, graph, way, position, ends
        self.track: dict[int, int] = {}
        """Link -> where it turns, along."""
        self.start: list[int] = []
        """Layer -> where it begins, along."""
        self.extent = [0] * graph.layers
        for slot in graph.slots:
            self.extent[slot.layer] = max(self.extent[slot.layer], slot.along)
        gaps: list[list[int]] = [[] for _ in range(graph.layers)]
        for index, link in enumerate(graph.links):
            gaps[graph.slots[link.near].layer].append(index)
        at = _MARGIN + _ROOT
        for layer, links in enumerate(gaps):
            self.start.append(at)
            at += self.extent[layer]
            turns = tracks([(ends[i, graph.links[i].near], ends[i, graph.links[i].far]) for i in links])
            # An arrow's head needs room before the box.
            first = at + (2 * GRID if layer % 2 == 0 else GRID)
            for index, track in zip(links, turns, strict=True):
                if track is not None:
                    self.track[index] = first + GRID * track
            count = 1 + max((track for track in turns if track is not None), default=-1)
            at += 3 * GRID + GRID * max(0, count - 1) if links else 0
        self.end = at

    def point(self, along: int, across: int) -> Point:
        return (along, across) if self.way == "right" else (across, along)

    def rect(self, along: int, across: int, length: int, breadth: int) -> Rect:
        x, y = self.point(along, across)
        w, h = self.point(length, breadth)
        return Rect(x, y, w, h)

    def box(self, state: int) -> tuple[int, int, int, int]:
        """Where a state's box begins along and across, and its extents; its slot is the one of the same number."""
        slot = self.graph.slots[state]
        begin = self.start[slot.layer] + (self.extent[slot.layer] - slot.along) // (2 * GRID) * GRID
        w, h = self.plan.sizes[state]
        length = _up(max(w if self.way == "right" else h, 4 * GRID * len(self.plan.loops.get(state, ()))))
        return begin, self.position[state] - slot.before, length, 2 * slot.before

    def layout(self) -> Layout:
        boxes = [self.box(state) for state in range(len(self.plan.sizes))]
        routes = [self.route(edge, boxes) for edge in range(len(self.plan.edges))]
        routes += [route for state in sorted(self.plan.loops) for route in self.loops(state, boxes[state])]
        begin, side, _, breadth = boxes[self.plan.root]
        root = (self.point(begin - _ROOT, side + breadth // 2), self.point(begin, side + breadth // 2))
        far = max(self.position[i] + slot.after for i, slot in enumerate(self.graph.slots))
        far = max(
            far, *(rect.y + rect.h if self.way == "right" else rect.x + rect.w for rect in self._labels(routes)), 0
        )
        width, height = self.point(self.end + _MARGIN, _up(far) + _MARGIN)
        return Layout(
            width=width,
            height=height,
            direction=self.way,
            boxes=tuple(self.rect(*box) for box in boxes),
            routes=tuple(sorted(routes, key=lambda route: route.transitions)),
            root=root,
        )

    def _labels(self, routes: Sequence[Route]) -> list[Rect]:
        return [route.label for route in routes] or [Rect(0, 0, 0, 0)]

    def route(self, edge: int, boxes: Sequence[tuple[int, int, int, int]]) -> Route:
        """The arrow of an edge, through its slots."""
        graph = self.graph
        links = [i for i, link in enumerate(graph.links) if link.edge == edge]
        near, far = graph.links[links[0]].near, graph.links[links[-1]].far
        points = [(boxes[near][0] + boxes[near][2], self.ends[links[0], near])]
        for i in links:
            if i in self.track:
                points += [
                    (self.track[i], self.ends[i, graph.links[i].near]),
                    (self.track[i], self.ends[i, graph.links[i].far]),
                ]
        points.append((boxes[far][0], self.ends[links[-1], far]))
        forward = near == self.plan.edges[edge][0]
        labelled = graph.links[links[0]].far if forward else graph.links[links[-1]].near
        return Route(
            transitions=self.plan.edge_transitions[edge],
            points=tuple(self.point(*p) for p in (points if forward else points[::-1])),
            label=self.label(labelled, self.plan.labels[edge], forward),
        )

    def label(self, slot: int, size: Size, forward: bool) -> Rect:
        """Above a line that runs to the right, right of one that runs down; at the end where the state is left."""
        w, h = size
        layer = self.graph.slots[slot].layer
        length = w if self.way == "right" else h
        along = self.start[layer] + (0 if forward else self.extent[layer] - length)
        across = self.position[slot] + (-h - 2 if self.way == "right" else 4)
        x, y = self.point(along, across)
        return Rect(x, y, w, h)

    def loops(self, state: int, box: tuple[int, int, int, int]) -> list[Route]:
        """Arrows from a state to itself: beside its box on the far side, one after the other."""
        begin, side, _, breadth = box
        edge, routes = side + breadth, []
        at = begin + GRID
        room = edge + _LOOP + 2
        below = begin
        for transitions, (w, h) in self.plan.loops[state]:
            around = [(at, edge), (at, edge + _LOOP), (at + 2 * GRID, edge + _LOOP), (at + 2 * GRID, edge)]
            label = Rect(begin + GRID, room, w, h) if self.way == "right" else Rect(edge + _LOOP + 4, below + 4, w, h)
            routes.append(Route(transitions, tuple(self.point(*p) for p in around), label))
            at += 4 * GRID
            room += h + 4
            below += h + 8
        return routes
