"""What goes over the socket: one fixed structure for commands, one for replies, and what makes a command refused.

Both ends run on one computer, so one clock stamps and judges: CLOCK_MONOTONIC, which nobody can set.
"""

from __future__ import annotations

import math
import struct
from enum import IntEnum, IntFlag
from typing import NamedTuple

MAGIC = b"TRAL"
VERSION = 1
NS = 1_000_000_000
"""Nanoseconds in a second."""


class Flag(IntFlag):
    """What a command asks for beside steering and throttle."""

    NONE = 0
    ARM = 1
    """Let the motor go; throttle must be 0."""
    DISARM = 2
    """Go to neutral; only ARM lets the motor go again."""
    STOP = 4
    """Emergency: latch the disarm."""


class State(IntEnum):
    """What the worker lets the motor do."""

    DISARMED = 0
    """Neutral while commands come, no pulses otherwise."""
    ARMED = 1
    """Commands go through."""
    LATCHED = 2
    """A fault: neutral, then no pulses, until an explicit ARM."""


class Reason(IntEnum):
    """Why the motor is not let go."""

    NONE = 0
    SILENCE = 1
    EVIDENCE = 2
    LOST = 3
    STOP = 4
    BUS = 5
    BOARD = 6
    KEEPER = 7
    SIGNAL = 8
    WORKER = 9


TOLD = {
    Reason.NONE: "nothing is wrong",
    Reason.SILENCE: "no new command came for too long: the policy hung, was stopped, or is too slow",
    Reason.EVIDENCE: "the car was told to drive while its observations did not change: a frozen sensor, or a car that "
    "does not move",
    Reason.LOST: "the source of the commands is gone",
    Reason.STOP: "a stop was commanded",
    Reason.BUS: "the PWM board did not take pulses: check its power and the wires SDA and SCL",
    Reason.BOARD: "the PWM board lost its settings: its supply broke down",
    Reason.KEEPER: "the process that watches over the worker is gone or stands still",
    Reason.SIGNAL: "the worker was told to end",
    Reason.WORKER: "the worker died or stood still",
}
"""Each reason in words."""


class Refusal(IntEnum):
    """Why a command counts for nothing."""

    NONE = 0
    FORM = 1
    """Another size, magic, version, or an unknown flag."""
    NOT_FINITE = 2
    FUTURE = 3
    """Stamped later than now."""
    OLD = 4
    """Stamped too long ago."""
    SEQUENCE = 5
    """Repeated, or out of order."""
    TIME = 6
    """Stamped before the command that came before it."""
    EVIDENCE = 7
    """The count of observations went back."""
    SOURCE = 8
    """From another source than the one that armed."""


class CommandPacket(NamedTuple):
    """What the policy's process sends."""

    sequence: int
    """Counts up from 1."""
    stamp_ns: int
    """Time at which it was sent."""
    steering: float
    throttle: float
    evidence: int
    """Number of observations until now that differed from the one before."""
    flags: Flag = Flag.NONE
    source: int = 0
    """What steers: another source never takes over from the one that armed."""


class Reply(NamedTuple):
    """What the worker answers to each packet, and sends at each change of its state."""

    state: State
    reason: Reason
    refusal: Refusal
    """Why the last packet was refused."""
    sequence: int
    """The newest command that was taken; 0: none yet."""
    stamp_ns: int
    steering: float
    throttle: float
    """Both as applied."""
    steering_us: float
    throttle_us: float
    """Pulses that were sent last, us; 0: none."""
    refused: int
    late: int
    """Commands that came more than two control periods after the one before."""
    silences: int
    """Times that silence made the worker go to neutral while it was armed."""
    retries: int
    """Transactions with the board that were tried again."""


NOTHING_YET = CommandPacket(sequence=0, stamp_ns=0, steering=0.0, throttle=0.0, evidence=0)
"""Stands for the command before the first one."""

_COMMAND = struct.Struct("<4sHHHxxQqddQ")
_REPLY = struct.Struct("<4sHBBBxxxQqddddIIII")
_FLAGS = int(Flag.ARM | Flag.DISARM | Flag.STOP)
ENDED = b"ended"
"""The last word of worker or keeper: no pulses leave the board. A process that ends without it has not done that."""
MAX_PACKET = 4096
"""No packet is longer."""


def pack(command: CommandPacket) -> bytes:
    """Bytes of a command."""
    return _COMMAND.pack(MAGIC, VERSION, command.flags, command.source, *command[:5])


def read(packet: bytes) -> CommandPacket | None:
    """Command of a packet, or None if it is none. Its content has not been judged yet: see `refusal`."""
    if len(packet) != _COMMAND.size:
        return None
    magic, version, flags, source, sequence, stamp_ns, steering, throttle, evidence = _COMMAND.unpack(packet)
    if magic != MAGIC or version != VERSION or flags & ~_FLAGS:
        return None
    return CommandPacket(sequence, stamp_ns, steering, throttle, evidence, Flag(flags), source)


def refusal(command: CommandPacket, before: CommandPacket, now_ns: int, max_age_ns: int) -> Refusal:
    """Why a command must not be followed.

    Args:
        command: the command.
        before: the last command that was not refused, or `NOTHING_YET`.
        now_ns: time, ns.
        max_age_ns: an older command is refused, ns.
    """
    faults = (
        (not (math.isfinite(command.steering) and math.isfinite(command.throttle)), Refusal.NOT_FINITE),
        (command.stamp_ns > now_ns, Refusal.FUTURE),
        (command.stamp_ns < now_ns - max_age_ns, Refusal.OLD),
        (command.sequence <= before.sequence, Refusal.SEQUENCE),
        (command.stamp_ns < before.stamp_ns, Refusal.TIME),
        (command.evidence < before.evidence, Refusal.EVIDENCE),
    )
    return next((fault for is_there, fault in faults if is_there), Refusal.NONE)


def pack_reply(reply: Reply) -> bytes:
    """Bytes of a reply."""
    return _REPLY.pack(MAGIC, VERSION, *reply)


def read_reply(packet: bytes) -> Reply | None:
    """Reply of a packet, or None if it is none."""
    if len(packet) != _REPLY.size:
        return None
    magic, version, state, reason, fault, *rest = _REPLY.unpack(packet)
    if magic != MAGIC or version != VERSION:
        return None
    return Reply(State(state), Reason(reason), Refusal(fault), *rest)
