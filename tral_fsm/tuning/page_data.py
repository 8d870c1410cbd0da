"""All that the report of a search shows, as data: `examples` drives for it, `report.tuning` draws it."""

from __future__ import annotations

from dataclasses import dataclass, field

from tral_fsm.tuning.classical.design import Gains
from tral_fsm.tuning.classical.loops import Response
from tral_fsm.tuning.found import Tuned
from tral_fsm.tuning.landscape import Line, Plane


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """The cost around the machine that was found."""

    plane: Plane | None
    """None: fewer than two real parameters."""
    lines: list[Line]
    courses: int
    """Courses that each point has driven."""
    landmarks: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Points of classical theory in the plane: name -> (x, y)."""


@dataclass(frozen=True, kw_only=True)
class WallLoops:
    """Gains of one wall following state before and after the search, and those of LQR, each with a driven step."""

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
    """All that the report of a search shows."""

    tuned: Tuned
    scenarios: tuple[str, ...]
    seeds: tuple[int, ...]
    """Seeds of the search, ascending."""
    randomization: str
    pooling: str
    """How the costs of drives become one."""
    command: str
    """The command line of the search."""
    version: str
    """Version of tral-env."""
    surroundings: Surroundings | None = None
    """None: not driven."""
    loops: WallLoops | None = None
    """None: the machine has no state that follows a wall."""
