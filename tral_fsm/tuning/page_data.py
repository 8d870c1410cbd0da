"""Data of the report of a search: `examples` drives it, `report.tuning` draws it."""

from __future__ import annotations

from dataclasses import dataclass

from tral_fsm.tuning.classical.design import Gains
from tral_fsm.tuning.classical.loops import Response
from tral_fsm.tuning.found import Tuned
from tral_fsm.tuning.landscape import Sensitivity


@dataclass(frozen=True, kw_only=True)
class WallLoops:
    """Gains of a wall following state before and after the search, and those of LQR, with their step responses."""

    state: str
    """Name of the state."""
    responses: dict[str, tuple[Gains, float, Response]]
    """"was", "now" and "LQR" -> gains, speed [m/s], response."""

    @property
    def gains(self) -> dict[str, tuple[Gains, float]]:
        """Name -> gains and speed [m/s]."""
        return {name: (gains, speed) for name, (gains, speed, _) in self.responses.items()}


@dataclass(frozen=True, kw_only=True)
class PageData:
    """Data of the report of a search."""

    tuned: Tuned
    scenarios: tuple[str, ...]
    seeds: tuple[int, ...]
    """Seeds of the search, ascending."""
    randomization: str
    pooling: str
    """Pooling of the costs of drives, see `Objective`."""
    command: str
    """The command line of the search."""
    version: str
    """Version of tral-env."""
    sensitivity: Sensitivity | None = None
    """Cost around the result; None: not driven."""
    loops: WallLoops | None = None
    """Step responses; None: the machine has no state that follows a wall."""
