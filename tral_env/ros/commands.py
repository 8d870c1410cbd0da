"""Commands on their way to the actuators: units, age, and who may drive when."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from tral_env.geometry import FULL_LOCK
from tral_env.ros.msg.sensor import AckermannDrive, AckermannDriveStamped
from tral_env.ros.patience import COMMAND_TIMEOUT_S, check_patience
from tral_env.ros.times import nanoseconds
from tral_env.se2 import clip
from tral_env.speed_control import SPEED_PER_THROTTLE, SpeedRegulator


def drive_of(steering: float, throttle: float) -> AckermannDrive:
    """An open-loop command as a message: the speed is 2.64 m/s for a full throttle."""
    return AckermannDrive(steering_angle=steering * FULL_LOCK, speed=throttle * SPEED_PER_THROTTLE)


def steering_of(drive: AckermannDrive) -> float:
    """Steering command in [-1, 1] of a message."""
    return clip(drive.steering_angle / FULL_LOCK)


def throttle_of(drive: AckermannDrive) -> float:
    """Throttle in [-1, 1] of an open-loop message."""
    return clip(drive.speed / SPEED_PER_THROTTLE)


@dataclass(frozen=True, kw_only=True)
class CommandLimits:
    """When a command is none any more."""

    timeout_s: float = COMMAND_TIMEOUT_S
    """A command may be so old, since its stamp and since it came, s. Then the car stops, and must be armed again."""
    patience_s: float = 2.0
    """After arming, the first command may take so long, s; until then the car stands in neutral."""

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("timeout_s", "patience_s"):
            check_patience(name, getattr(self, name))


class Received(NamedTuple):
    """A command that came."""

    message: AckermannDriveStamped
    source: int
    """Who sent it."""
    open_loop: bool


class CommandGate:
    """Lets commands through while the car is armed. What stops it latches: only `arm` undoes it.

    - No new command for `timeout_s`, or only commands whose stamps are older than that, or as far in the future: the
      age of a command by a wrong clock is not known.
    - Commands of two publishers.
    - A command that is no finite number.
    - `disarm`.

    A stamp of 0 means: now. The stamp of a command that answers readings is the stamp of these readings; so its age is
    that of what the policy saw, on the car's own clock.
    """

    def __init__(self, limits: CommandLimits | None = None) -> None:
        """Begin disarmed."""
        self.limits = limits or CommandLimits()
        self.armed = False
        self.why = "not armed yet"
        """Why the car is not armed."""
        self.late = self.refused = self.taken = 0
        """Number of commands that came too late; that were refused because they are none, come from a second publisher
        or are of another clock; and that were taken."""
        self.answers_ns = 0
        """Stamp of the command that was taken last, ns."""
        self._regulator = SpeedRegulator()
        self._source: int | None = None
        self._last: Received | None = None
        self._came_s = self._armed_s = 0.0
        self._off = 0
        """Number of commands with a stamp that is refused, since the last good one."""

    @property
    def has_command(self) -> bool:
        """Whether a command was taken since the car was armed."""
        return self._last is not None

    def arm(self, now_s: float) -> None:
        """Take commands from now on; older ones are forgotten."""
        self.armed, self.why, self.answers_ns = True, "", 0
        self._source, self._last, self._armed_s, self._off = None, None, now_s, 0
        self._regulator = SpeedRegulator()

    def disarm(self, why: str) -> None:
        """Take no more commands."""
        if self.armed:
            self.armed, self.why = False, why
        self._last = None

    def _disarm_silent(self, time: str) -> None:
        why = f"no command for {time}"
        if self._off:
            why += f"; {self._off} came with stamps over {self.limits.timeout_s:g} s off: compare both clocks"
        self.disarm(why)

    def hear(self, received: Received, now_s: float, now_ns: int) -> None:
        """Take a command.

        Args:
            received: the command.
            now_s: time on a clock that never goes back, s.
            now_ns: time of ROS, ns.
        """
        if not self.armed:
            return None
        drive, stamp_ns = received.message.drive, nanoseconds(received.message.header.stamp)
        if not (math.isfinite(drive.steering_angle) and math.isfinite(drive.speed)):
            self.refused += 1
            return self.disarm(f"a command is no number: steering_angle {drive.steering_angle}, speed {drive.speed}")
        if self._source is not None and received.source != self._source:
            self.refused += 1
            return self.disarm("two publishers send commands: end one of them")
        self._source = received.source
        if stamp_ns and abs(now_ns - stamp_ns) > self.limits.timeout_s * 1e9:
            self.late += stamp_ns < now_ns
            self.refused += stamp_ns > now_ns
            self._off += 1
            return None
        self.taken += 1
        self._off = 0
        self.answers_ns = stamp_ns or now_ns
        self._last, self._came_s = received, now_s
        return None

    def command(self, speed: float | None, now_s: float) -> tuple[float, float] | None:
        """Steering and throttle for the next tick; None: the car must stop, and `why` tells why.

        Args:
            speed: of the car from its hall sensor, m/s; None: no hall sensor tells it. Then no speed can be regulated.
            now_s: time on a clock that never goes back, s.
        """
        if not self.armed:
            return None
        if self._last is None:
            if now_s - self._armed_s > self.limits.patience_s:
                self._disarm_silent(f"{self.limits.patience_s:g} s after arming")
                return None
            return 0.0, 0.0
        if now_s - self._came_s > self.limits.timeout_s:
            self._disarm_silent(f"{self.limits.timeout_s:g} s")
            return None
        drive = self._last.message.drive
        if self._last.open_loop:
            return steering_of(drive), throttle_of(drive)
        if speed is None:
            if now_s - self._armed_s > self.limits.patience_s:
                self.disarm("a speed is commanded, and no hall sensor tells the car's: send ackermann_cmd_open_loop")
                return None
            return steering_of(drive), 0.0
        return steering_of(drive), self._regulator.drive(drive.speed, speed)
