"""Times of ROS: ns since its epoch <-> messages."""

from __future__ import annotations

from tral_env.ros.msg.std import Time

SECOND_NS = 1_000_000_000


def stamp(time_ns: int) -> Time:
    """A time as a message."""
    return Time(sec=time_ns // SECOND_NS, nanosec=time_ns % SECOND_NS)


def nanoseconds(time: Time) -> int:
    """A message as a time, ns."""
    return time.sec * SECOND_NS + time.nanosec


def seconds_ns(seconds: float) -> int:
    """Seconds in ns."""
    return round(seconds * SECOND_NS)
