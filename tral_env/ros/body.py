"""The car behind the car node: a real one, its twin, or a simulated one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from tral_env.ros.readings import Told


class Tick(NamedTuple):
    """What came of a tick."""

    readings: Mapping[str, float]
    over: str = ""
    """Why the drive is over; empty: it goes on."""
    trouble: str = ""
    """Why the sensors read nothing; empty: they read."""


class Body(Protocol):
    """A car that the node drives tick by tick."""

    @property
    def name(self) -> str:
        """Its kind, for `hardware_id` of the diagnostics."""
        ...

    @property
    def sim_time_s(self) -> float | None:
        """Simulated time since the body was made, s; None: the body lives in real time."""
        ...

    @property
    def sees(self) -> bool:
        """Whether its readings tell gates and markers; where a camera node does that, they do not."""
        ...

    @property
    def camera_x(self) -> float:
        """The camera stands this far ahead of the rear axle, m."""
        ...

    def arm(self) -> Tick:
        """Make ready to drive, in neutral.

        Raises:
            TralError: it does not.
        """
        ...

    def step(self, steering: float, throttle: float) -> Tick:
        """Drive for a tick, to its end in real time.

        Raises:
            HardwareError: the car was stopped.
        """
        ...

    def rest(self) -> Tick:
        """A tick of a car that is not armed: a rolling one is stopped."""
        ...

    def stop(self) -> None:
        """Stop at once; only `arm` undoes it."""

    def reset(self, seed: int) -> None:
        """Put the car at the start of the course of a seed; a real car does nothing.

        Raises:
            TralError: it has no such course, or is broken.
        """

    def extra(self, now_ns: int) -> Sequence[Told]:
        """What a simulated car tells beside its readings, in each tick."""
        ...

    def latched(self, now_ns: int) -> Sequence[Told]:
        """What is told once a drive and kept for those who come later."""
        ...

    def close(self) -> None:
        """Stop, and let go of the car."""
