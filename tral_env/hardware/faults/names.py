"""The faults by name: what each means, what is done about it, and by which limit it is noticed."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple


class Decision(StrEnum):
    """What is done about a fault."""

    STOP = "stop"
    """The car stops and stays stopped; only a reset arms it again."""
    WARN = "warn"
    """It is told, and the drive goes on."""


class Fault(NamedTuple):
    """One fault."""

    name: str
    decision: Decision
    limits: tuple[str, ...]
    """Fields of `tral_env.hardware.faults.limits.FaultLimits` that decide."""
    meaning: str


FAULTS = {
    fault.name: fault
    for fault in (
        Fault("no motion", Decision.STOP, ("standstill_s", "blind_m"),
              "told to drive forward, and the hall sensor counts nothing: the car is stuck, or a wire is off"),
        Fault("sonar silent", Decision.STOP, ("silent_s",), "an ultrasonic gives no new range"),
        Fault("sonar frozen", Decision.STOP, ("frozen_m", "frozen_cm_m"),
              "an ultrasonic gives one range while the car moves on"),
        Fault("camera stale", Decision.STOP, ("image_s",), "no new image comes"),
        Fault("camera frozen", Decision.STOP, ("image_s",), "the camera gives one image while the car moves on"),
        Fault("battery empty", Decision.STOP, ("battery_empty_v",), "its voltage under load would damage it"),
        Fault("battery low", Decision.WARN, ("battery_low_v",), "charge it soon"),
        Fault("too near", Decision.STOP, ("reaction_s", "rolling_share", "echoes"),
              "something ahead is nearer than a stop needs"),
        Fault("bus errors", Decision.WARN, ("retries",), "many transactions with the board are tried again"),
        Fault("loop late", Decision.WARN, ("late_share",), "many ticks come late: the policy is too slow"),
    )
}  # fmt: skip
"""Name -> fault, in the order in which they are judged."""


class Finding(NamedTuple):
    """A fault that was noticed."""

    fault: Fault
    detail: str
    """What was measured."""

    def __str__(self) -> str:
        """The line of a log."""
        return f"{self.fault.decision.upper()} {self.fault.name}: {self.detail} ({self.fault.meaning})"
