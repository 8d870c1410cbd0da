"""What makes a transition fire, as plain validated data.

Here stands what every condition has in common. The types of conditions stand in `tral_fsm.conditions`, each beside the
class that runs it; `CONDITIONS` lists them.
"""

from __future__ import annotations

from typing import ClassVar

from tral_fsm.definition.needs import NOTHING
from tral_fsm.definition.registry import Registry
from tral_fsm.definition.validated import Spec


class ConditionSpec(Spec):
    """Base of the specs of all conditions. A spec of your own derives from it and gives its name in `type`."""

    asks_owner_finished: ClassVar[bool] = False
    """The state that the transition leaves must be able to say that it is finished."""
    asks_owner_target: ClassVar[bool] = False
    """The state that the transition leaves must take a target."""

    joined: ClassVar[tuple[str, str] | None] = None
    """Words before the parts of a condition that combines others, and between them; None: its type and parentheses."""

    type: str

    @property
    def parts(self) -> tuple[ConditionSpec, ...]:
        """The conditions that this condition combines."""
        return ()

    @property
    def hands_over(self) -> bool:
        """Whether the condition may hand a gate to the next state."""
        return False

    @property
    def readings_needed(self) -> frozenset[str]:
        """Readings without which the condition cannot tell, as `tral_env.interface.CORE_FIELDS` names them.

        Those of its parts are added.
        """
        return NOTHING

    @property
    def holds_always(self) -> bool:
        """Whether the condition holds in every tick, whatever the car reads."""
        return False

    @property
    def holds_never(self) -> bool:
        """Whether the condition never holds, whatever the car reads."""
        return False


CONDITIONS = Registry(ConditionSpec)
"""Every known type of condition. Importing `tral_fsm` adds those of the package, `conditions.register` any other."""
