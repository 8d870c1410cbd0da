"""What states do."""

from tral_fsm.states.base import State, runs

__all__ = ["State", "runs"]
