"""Layout of a machine, with room for the words of its picture."""

from __future__ import annotations

from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.draw import text
from tral_fsm.draw.layered.arrange import arrange
from tral_fsm.draw.layered.content import LabelSize, StateSize
from tral_fsm.draw.layered.shapes import Arrangement, Direction


def layout(
    machine: MachineDefinition,
    *,
    direction: Direction | None = None,
    bundled: bool = True,
    state_size: StateSize = text.state_size,
    label_size: LabelSize = text.label_size,
) -> Arrangement:
    """Lay out a machine without its inner machines.

    Args:
        machine: a definition that `check` accepts.
        direction: direction of most arrows; None: the one with the better picture.
        bundled: one arrow for all transitions from one state to another; else an arrow for each.
        state_size: function for the smallest width and height of a state's box, px; default: that of its words.
        label_size: function for the width and height of an arrow's text, px; default: those of its words.

    Returns:
        The arrangement, always the same for the same machine.
    """
    return arrange(machine, state_size=state_size, label_size=label_size, direction=direction, bundled=bundled)
