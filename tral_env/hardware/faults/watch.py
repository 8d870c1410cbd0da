"""All laws at work: a look at the car in each tick, and what was found."""

from __future__ import annotations

from tral_env.hardware.faults.laws import laws_for
from tral_env.hardware.faults.limits import FaultLimits
from tral_env.hardware.faults.look import Look
from tral_env.hardware.faults.names import FAULTS, Decision, Finding


class FaultWatch:
    """Watches one car. The first fault that stops it stays until `reset`."""

    def __init__(self, provided: frozenset[str], limits: FaultLimits | None = None, brake: float = 0.0) -> None:
        """Watch what a car measures.

        Args:
            provided: names of the readings that it has; a law without its readings is off.
            limits: when a fault counts.
            brake: throttle by which the car is stopped, in [-1, 0]: `Limits.brake` of the actuator's process.
        """
        self._provided, self._limits, self._brake = provided, limits or FaultLimits(), brake
        self.reset()

    def reset(self) -> None:
        """Begin anew, with a car that stands."""
        self._laws = list(laws_for(self._provided, self._limits, self._brake))
        self.stopped: Finding | None = None
        """The fault that stopped the car."""
        self.warnings: tuple[Finding, ...] = ()
        """The faults that are there now and are only told."""

    def update(self, look: Look) -> Finding | None:
        """Judge the car after a tick: the fault that stops it, or nothing."""
        found = [Finding(FAULTS[name], detail) for name, law in self._laws if (detail := law.update(look))]
        self.warnings = tuple(finding for finding in found if finding.fault.decision is Decision.WARN)
        stops = [finding for finding in found if finding.fault.decision is Decision.STOP]
        if self.stopped is None and stops:
            self.stopped = stops[0]
        return self.stopped
