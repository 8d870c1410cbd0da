"""Profiles of quality of service, as ROS 2 names them, and what Cyclone DDS is told of each."""

from __future__ import annotations

from dataclasses import dataclass

from cyclonedds.core import Policy, Qos


@dataclass(frozen=True, kw_only=True)
class Profile:
    """How messages of a topic are handed on."""

    reliable: bool = True
    """Whether a lost message is sent again."""
    depth: int = 1
    """So many messages are kept."""
    latched: bool = False
    """Whether one who comes later gets the last messages too ("transient local")."""
    deadline_s: float | None = None
    """The writer promises a message at least this often, s."""
    lease_s: float | None = None
    """A writer whose process is dead or cut off counts as gone after this time, s; None: after 10 s."""

    def qos(self, user_data: bytes = b"") -> Qos:
        """The same for Cyclone DDS; the bytes are plain CDR, as ROS 2 has them."""
        second = 1_000_000_000
        policies = [
            Policy.Reliability.Reliable(second // 10) if self.reliable else Policy.Reliability.BestEffort,
            Policy.Durability.TransientLocal if self.latched else Policy.Durability.Volatile,
            Policy.History.KeepLast(self.depth),
            Policy.DataRepresentation(use_cdrv0_representation=True),
        ]
        if self.latched:
            policies.append(
                Policy.DurabilityService(
                    cleanup_delay=0,
                    history=Policy.History.KeepLast(self.depth),
                    max_samples=-1,
                    max_instances=-1,
                    max_samples_per_instance=-1,
                )
            )
        if self.deadline_s is not None:
            policies.append(Policy.Deadline(round(self.deadline_s * second)))
        if self.lease_s is not None:
            policies.append(Policy.Liveliness.Automatic(round(self.lease_s * second)))
        if user_data:
            policies.append(Policy.Userdata(user_data))
        return Qos(*policies)


SENSOR_DATA = Profile(reliable=False, depth=5)
"""Readings: a new one is worth more than a lost one."""
SEEN = Profile(reliable=False, depth=5, lease_s=0.1)
"""What a camera sees: who waits for it must soon know that nobody looks any more."""
STATE = Profile(depth=10)
"""What comes with each tick and what a user's tool may ask for reliably: odometry, joints, transforms."""
LATCHED = Profile(latched=True)
"""What seldom changes: the model of the car, the static transforms, the course, the active state."""
WHO = Profile(latched=True, lease_s=1.0)
"""Whether the car takes commands: others must know how many cars there are."""
COMMAND = Profile(depth=1, deadline_s=0.1, lease_s=0.1)
"""Commands: the last one counts, and one comes at least this often."""
ANY_COMMAND = Profile(depth=1)
"""Whose commands are taken: a reader that wanted a deadline would not hear `ros2 topic pub`, which promises none."""
CLOCK = Profile(reliable=False, depth=1)
"""The simulated time."""
LOG = Profile(depth=100, latched=True)
"""Lines of logs."""
GRAPH = LATCHED
"""Which node owns what."""
