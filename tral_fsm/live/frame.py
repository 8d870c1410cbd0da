"""What the page shows of one moment: plain values that nobody changes any more, so that any thread may read them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from tral_env.checks import one_of
from tral_env.course.plan import Plan
from tral_env.errors import ConfigError
from tral_env.se2 import Pose
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.evaluation.choices import Camera, check_families
from tral_fsm.runtime.machine import Transit

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Course:
    """What is driven."""

    scenario: str = "office"
    """Family of the courses."""
    course: str | None = None
    """Name or file of one course instead."""
    seed: int = 7
    randomization: str = "default"
    """Name of a level, or path of a file of ranges."""
    camera: Camera = "projected"

    def __post_init__(self) -> None:
        """Check the names."""
        check_families([self.scenario])
        one_of("camera", self.camera, get_args(Camera))
        if self.seed < 0:
            raise ConfigError(f"seed {self.seed}: expected 0 or more")


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
    speed_mps: float = math.nan
    """True speed; NaN: nobody knows."""
    wanted_mps: float = math.nan
    """Speed that the driver regulates; NaN: none."""
    clearance_error_m: float = math.nan
    """True clearance to the followed wall less the wanted one; NaN where none is wanted or measured."""
    gates: tuple[int, int] = (0, 0)
    """Gates passed, and gates of the course."""
    progress: float = math.nan
    """Share of the route, 0 to 1; NaN: nobody knows."""
    silent: tuple[str, ...] = ()
    """Ultrasonics that were taken away."""
    ended: str = ""
    """How the drive ended; empty: it goes on."""


@dataclass(frozen=True, kw_only=True)
class Ghost:
    """Where the car of the best earlier drive was at this moment of it."""

    name: str
    """Who drove, and how it went."""
    pose: Pose


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
    ghost: Ghost | None = None
    """The best earlier drive of the course; None: there was none."""
    machine: MachineDefinition | None = None
    """The machine that drives the first car."""
    as_loaded: MachineDefinition | None = None
    """The same as its file has it."""
    paused: bool = False
    speed: float = 1.0
    """How fast the clock of the drive is asked to run, 1: real time."""
    lateness: str = ""
    """What is told where real time is not kept."""
    course: Course = field(default_factory=Course)
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Parameters of the first car that may be changed, by name; empty: it is not simulated."""
    notice: str = ""
    """What became of the last order, if it could not be carried out."""
    picture: Callable[[], NDArray[np.uint8]] | None = None
    """Renders what the camera of the first car shows, (h, w, 3)."""
