"""What the page shows of one moment: plain values that nobody changes any more, so that any thread may read them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.course.plan import Plan
from tral_env.se2 import Pose
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.runtime.machine import Transit

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class CarFrame:
    """One car at one moment."""

    name: str
    """Who drives it."""
    time_s: float
    """Since the start."""
    readings: Mapping[str, float]
    """What its driver was told, by the names of `tral_env.interface.CORE_FIELDS`."""
    action: tuple[float, float]
    """Steering and throttle that the driver answered."""
    pose: Pose | None = None
    """True x, y [m], yaw [rad] in the course's frame; None: nobody knows."""
    qpos: Array | None = None
    """(nq,) state of the simulated car."""
    state: str = ""
    """Name of the active state."""
    transit: Transit | None = None
    """The last transition that fired."""
    estimate: CarEstimate | None = None
    """What the machine believes."""
    truth: Mapping[str, Any] = field(default_factory=dict)
    """Info of the environment."""
    ended: str = ""
    """How the drive ended; empty: it goes on."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """All cars at one moment."""

    episode: int
    """Number of the drive; another number tells that course and machine may be others."""
    title: str
    """What is driven."""
    plan: Plan | None
    """The course; None: it is not known."""
    cars: tuple[CarFrame, ...]
    machine: MachineDefinition | None = None
    """The machine that drives the first car."""
    paused: bool = False
    speed: float = 1.0
    """How fast the clock of the drive is asked to run, 1: real time."""
    lateness: str = ""
    """What is told where real time is not kept."""
