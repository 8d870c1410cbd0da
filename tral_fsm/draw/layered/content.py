"""Content of a layout: sizes of boxes and labels, arrows between states, arrows from states to themselves."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tral_fsm.definition.machine import MachineDefinition, StateSpec, TransitionSpec
from tral_fsm.draw.layered.graph import GRID, Edge, Graph, Slot, layered, round_up
from tral_fsm.draw.layered.shapes import Direction, Size

StateSize = Callable[[StateSpec], Size]
"""Function for the smallest width and height of a state's box, px."""
LabelSize = Callable[[Sequence[TransitionSpec], Sequence[str]], Size]
"""Function for the width and height of an arrow's text, px, from its transitions and their ordinals."""

LOOP = 20
"""Distance to which an arrow from a state to itself leads away, px."""


def ordinals(machine: MachineDefinition) -> list[str]:
    """Ordinal of each transition among those that leave its state, such as "2. "; empty for an only one."""
    leaving: dict[int | str, list[int]] = {}
    for index, transition in enumerate(machine.transitions):
        leaving.setdefault(transition.source, []).append(index)
    found = [""] * len(machine.transitions)
    for indices in leaving.values():
        for place, index in enumerate(indices, 1):
            found[index] = f"{place}. " if len(indices) > 1 else ""
    return found


class Content:
    """Sizes, edges and loops of a machine."""

    def __init__(self, machine: MachineDefinition, bundled: bool, state_size: StateSize, label_size: LabelSize) -> None:
        index = {state.id: i for i, state in enumerate(machine.states)}
        self.root = index[machine.root]
        bundles: dict[tuple[int, int, int], list[int]] = {}
        for i, t in enumerate(machine.transitions):
            bundles.setdefault((index[t.source], index[t.target], 0 if bundled else i), []).append(i)
        place = ordinals(machine)
        sizes = {
            key: label_size([machine.transitions[i] for i in found], [place[i] for i in found])
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
        """Extents of a state's box along and across, with room for its text and its arrows."""
        w, h = self.sizes[state]
        along, across = (w, h) if way == "right" else (h, w)
        sides = [rank[b] > rank[a] if a == state else rank[a] > rank[b] for a, b in self.edges if state in (a, b)]
        arrows = max(sides.count(True), sides.count(False))
        loops = len(self.loops.get(state, ()))
        return round_up(max(along, 4 * GRID * loops)), round_up(max(across, 2 * GRID * (arrows + 1)), 2 * GRID)

    def graph(self, rank: Sequence[int], way: Direction) -> Graph:
        """The graph for ranks and a direction."""
        boxes = []
        for state in range(len(self.sizes)):
            along, across = self.box(state, rank, way)
            beside, further = self._loop_room(state, way)
            boxes.append(Slot(0, across // 2, across // 2 + beside, max(along, further), reach=across // 2 - GRID))
        labels = []
        for w, h in self.labels:
            labels.append(
                (round_up(h + 4), GRID // 2, round_up(w + GRID))
                if way == "right"
                else (5, round_up(w + 10) - 5, round_up(h + 4))
            )
        return layered(self.edges, rank, boxes, labels)

    def _loop_room(self, state: int, way: Direction) -> Size:
        """Room for a state's arrows to itself: across beyond the box, and along."""
        loops = self.loops.get(state)
        if not loops:
            return 0, 0
        if way == "right":
            return LOOP + round_up(sum(h + 4 for _, (_, h) in loops)), round_up(
                max(w for _, (w, _) in loops) + 2 * GRID
            )
        return LOOP + round_up(max(w for _, (w, _) in loops) + GRID), round_up(sum(h + 8 for _, (_, h) in loops))
