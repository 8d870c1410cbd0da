"""A command that is not right in every respect counts for nothing."""

import math
from typing import Any

import pytest
from rig import MS

from tral_env.hardware.actuator.wire import (
    NOTHING_YET,
    TOLD,
    CommandPacket,
    Flag,
    Reason,
    Refusal,
    Reply,
    State,
    pack,
    pack_reply,
    read,
    read_reply,
    refusal,
)

NOW = 1000 * MS
BEFORE = CommandPacket(7, NOW - 12 * MS, 0.1, 0.2, 5)
RIGHT = CommandPacket(8, NOW - MS, -0.5, 0.25, 6, Flag.ARM, 3)
REPLY = Reply(State.LATCHED, Reason.BUS, Refusal.OLD, 8, NOW, -0.5, 0.25, 1600.0, 1400.0, 1, 2, 3, 4)


def test_what_is_packed_is_read() -> None:
    assert read(pack(RIGHT)) == RIGHT
    assert read_reply(pack_reply(REPLY)) == REPLY


@pytest.mark.parametrize(
    "packet",
    [
        b"",
        pack(RIGHT)[:-1],
        pack(RIGHT) + b"\0",
        b"LART" + pack(RIGHT)[4:],
        pack(RIGHT)[:4] + b"\2\0" + pack(RIGHT)[6:],
        pack(RIGHT)[:6] + b"\x08\0" + pack(RIGHT)[8:],
        pack_reply(REPLY),
    ],
    ids=["nothing", "short", "long", "magic", "version", "flag", "reply"],
)
def test_what_is_no_command_is_none(packet: bytes) -> None:
    assert read(packet) is None


@pytest.mark.parametrize(
    "packet", [b"", b"LART" + pack_reply(REPLY)[4:], pack_reply(REPLY)[:4] + b"\2\0" + pack_reply(REPLY)[6:]]
)
def test_what_is_no_reply_is_none(packet: bytes) -> None:
    assert read_reply(packet) is None


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({}, Refusal.NONE),
        ({"steering": math.nan}, Refusal.NOT_FINITE),
        ({"steering": math.inf}, Refusal.NOT_FINITE),
        ({"throttle": math.nan}, Refusal.NOT_FINITE),
        ({"throttle": -math.inf}, Refusal.NOT_FINITE),
        ({"stamp_ns": NOW}, Refusal.NONE),
        ({"stamp_ns": NOW + 1}, Refusal.FUTURE),
        ({"stamp_ns": BEFORE.stamp_ns}, Refusal.NONE),
        ({"stamp_ns": BEFORE.stamp_ns - 1}, Refusal.TIME),
        ({"stamp_ns": NOW - 50 * MS - 1}, Refusal.OLD),
        ({"sequence": 7}, Refusal.SEQUENCE),
        ({"sequence": 6}, Refusal.SEQUENCE),
        ({"sequence": 2**64 - 1}, Refusal.NONE),
        ({"evidence": 5}, Refusal.NONE),
        ({"evidence": 4}, Refusal.EVIDENCE),
    ],
)
def test_a_command_is_refused_for(changes: dict[str, Any], fault: Refusal) -> None:
    assert refusal(RIGHT._replace(**changes), BEFORE, NOW, 50 * MS) is fault


def test_the_oldest_command_that_may_be_followed() -> None:
    old = RIGHT._replace(stamp_ns=NOW - 50 * MS)
    assert refusal(old, NOTHING_YET, NOW, 50 * MS) is Refusal.NONE


def test_every_reason_is_told_in_words() -> None:
    assert set(TOLD) == set(Reason)
