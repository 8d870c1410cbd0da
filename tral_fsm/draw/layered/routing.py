"""Last step of a layout: from positions and layers to the points of boxes, arrows and labels."""

from __future__ import annotations

from collections.abc import Sequence

from tral_fsm.draw.layered.content import LOOP, Content
from tral_fsm.draw.layered.graph import GRID, Graph, round_up
from tral_fsm.draw.layered.shapes import Arrangement, Direction, Point, Rect, Route, Size
from tral_fsm.draw.layered.tracks import tracks

MARGIN = 20
"""Empty border of a picture, px."""
_ROOT = 30
"""Length of the arrow that points to the root, px."""


class Router:
    """Turns positions across and layers along into points: boxes, arrows, labels."""

    def __init__(
        self, content: Content, graph: Graph, way: Direction, position: list[int], ends: dict[tuple[int, int], int]
    ) -> None:
        self.content, self.graph, self.way, self.position, self.ends = content, graph, way, position, ends
        self.track: dict[int, int] = {}
        """Link -> place along at which it turns."""
        self.start: list[int] = []
        """Start of each layer along."""
        self.extent = [0] * graph.layers
        for slot in graph.slots:
            self.extent[slot.layer] = max(self.extent[slot.layer], slot.along)
        gaps: list[list[int]] = [[] for _ in range(graph.layers)]
        for index, link in enumerate(graph.links):
            gaps[graph.slots[link.near].layer].append(index)
        at = MARGIN + _ROOT
        for layer, links in enumerate(gaps):
            self.start.append(at)
            at += self.extent[layer]
            turns = tracks([(ends[i, graph.links[i].near], ends[i, graph.links[i].far]) for i in links])
            # The head of an arrow needs room before the box.
            first = at + (2 * GRID if layer % 2 == 0 else GRID)
            for index, track in zip(links, turns, strict=True):
                if track is not None:
                    self.track[index] = first + GRID * track
            count = 1 + max((track for track in turns if track is not None), default=-1)
            at += 3 * GRID + GRID * max(0, count - 1) if links else 0
        self.end = at

    def point(self, along: int, across: int) -> Point:
        """A point of the picture."""
        return (along, across) if self.way == "right" else (across, along)

    def rect(self, along: int, across: int, length: int, breadth: int) -> Rect:
        """A rectangle of the picture."""
        x, y = self.point(along, across)
        w, h = self.point(length, breadth)
        return Rect(x, y, w, h)

    def box(self, state: int) -> tuple[int, int, int, int]:
        """Start of a state's box along and across, and its extents; its slot has the same number."""
        slot = self.graph.slots[state]
        begin = self.start[slot.layer] + (self.extent[slot.layer] - slot.along) // (2 * GRID) * GRID
        w, h = self.content.sizes[state]
        length = round_up(max(w if self.way == "right" else h, 4 * GRID * len(self.content.loops.get(state, ()))))
        return begin, self.position[state] - slot.before, length, 2 * slot.before

    def arrangement(self) -> Arrangement:
        """The whole arrangement."""
        boxes = [self.box(state) for state in range(len(self.content.sizes))]
        routes = [self.route(edge, boxes) for edge in range(len(self.content.edges))]
        routes += [route for state in sorted(self.content.loops) for route in self.loops(state, boxes[state])]
        begin, side, _, breadth = boxes[self.content.root]
        root = (self.point(begin - _ROOT, side + breadth // 2), self.point(begin, side + breadth // 2))
        far = max(self.position[i] + slot.after for i, slot in enumerate(self.graph.slots))
        far = max(
            far, *(rect.y + rect.h if self.way == "right" else rect.x + rect.w for rect in self._labels(routes)), 0
        )
        width, height = self.point(self.end + MARGIN, round_up(far) + MARGIN)
        return Arrangement(
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
        forward = near == self.content.edges[edge][0]
        labelled = graph.links[links[0]].far if forward else graph.links[links[-1]].near
        return Route(
            transitions=self.content.edge_transitions[edge],
            points=tuple(self.point(*p) for p in (points if forward else points[::-1])),
            label=self.label(labelled, self.content.labels[edge], forward),
        )

    def label(self, slot: int, size: Size, forward: bool) -> Rect:
        """Room of a label: above a line to the right, or right of a line down, at the end of the source state."""
        w, h = size
        layer = self.graph.slots[slot].layer
        length = w if self.way == "right" else h
        along = self.start[layer] + (0 if forward else self.extent[layer] - length)
        across = self.position[slot] + (-h - 2 if self.way == "right" else 4)
        x, y = self.point(along, across)
        return Rect(x, y, w, h)

    def loops(self, state: int, box: tuple[int, int, int, int]) -> list[Route]:
        """Arrows from a state to itself, one after the other on the far side of its box."""
        begin, side, _, breadth = box
        edge, routes = side + breadth, []
        at = begin + GRID
        room = edge + LOOP + 2
        below = begin
        for transitions, (w, h) in self.content.loops[state]:
            around = [(at, edge), (at, edge + LOOP), (at + 2 * GRID, edge + LOOP), (at + 2 * GRID, edge)]
            label = Rect(begin + GRID, room, w, h) if self.way == "right" else Rect(edge + LOOP + 4, below + 4, w, h)
            routes.append(Route(transitions, tuple(self.point(*p) for p in around), label))
            at += 4 * GRID
            room += h + 4
            below += h + 8
        return routes
