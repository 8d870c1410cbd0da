"""The arrangement of a machine as its picture has it: with room for the picture's words."""

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
    """Lay out a machine; its inner machines are not looked at.

    Args:
        machine: a definition whose ids and ends are right (`check`).
        direction: where most arrows lead; None: as the picture comes out better.
        bundled: one arrow for all transitions from one state to another; else one for each.
        state_size: gives the least width and height of a state's box, px; else room for the picture's words.
        label_size: gives width and height of an arrow's text, px; else room for the picture's words.

    Returns:
        The arrangement: always the same for the same machine.
    """
    return arrange(machine, state_size=state_size, label_size=label_size, direction=direction, bundled=bundled)
