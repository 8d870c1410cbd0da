"""What the two serial boards of the original cars tell: parsers that take any bytes, in pieces of any size."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from tral_env.hardware.actuator.serial_boards import GROUPS

_HEADER = b"\x00\x0f"
_FRAME = struct.Struct("<2sHHHBHH")
"""Header, ranges front, right and left, line sensor, hall count, battery; the low byte comes first."""
_END = b"\x03"
"""The ucboard ends each message so."""
_GROUP = re.compile(r"##(\d{1,2}):(.*)", re.DOTALL)
_VALUE = re.compile(r"[0-9]{1,5}|\[[^\]]*\]")
"""A number, or a reason for there being none, such as [mfault]."""
_BEYOND = ("[over]", "[range]", "[under]")
"""The ucboard says so of a value beyond the sensor's range."""
_MAX_MESSAGE = 4096
"""Bytes without an end beyond this length are no message."""


class SerialFrame(NamedTuple):
    """One frame of the board of 2016, as it stands on the wire."""

    front: int
    right: int
    left: int
    line: int
    hall: int
    battery: int


class FrameParser:
    """Finds the frames of 13 bytes of the board of 2016.

    A frame has a header and no checksum, and the header may stand within the data too. So a frame counts if the header
    of the next one follows it, or if it follows one that counted.
    """

    def __init__(self) -> None:
        """Begin without any byte."""
        self._waiting = bytearray()
        self._in_step = False

    def feed(self, data: bytes) -> list[SerialFrame]:
        """Take bytes, and give the frames that are whole now."""
        self._waiting += data
        return list(self._frames())

    def _frames(self) -> Iterator[SerialFrame]:
        waiting, size = self._waiting, _FRAME.size
        while len(waiting) >= size:
            if not waiting.startswith(_HEADER):
                self._in_step = False
                at = waiting.find(_HEADER, 1)
                del waiting[: at if at > 0 else len(waiting) - 1]
                if len(waiting) < size:
                    return
            if not self._in_step:
                if len(waiting) < size + len(_HEADER):
                    return
                if not waiting.startswith(_HEADER, size):
                    del waiting[0]
                    continue
                self._in_step = True
            yield SerialFrame(*_FRAME.unpack_from(waiting)[1:])
            del waiting[:size]


class TextParser:
    """Finds the measurements in what the ucboard says; answers and messages of other kinds are passed over."""

    def __init__(self) -> None:
        """Begin without any byte."""
        self._waiting = b""

    def feed(self, data: bytes) -> list[Mapping[str, float | None]]:
        """Take bytes, and give the groups that are whole now.

        Returns:
            Channel -> value of 16 bits; inf: too large for the sensor, as a range without an echo; None: no value.
        """
        *messages, rest = (self._waiting + data).split(_END)
        self._waiting = rest[-_MAX_MESSAGE:]
        groups = (_group(message.decode("latin-1")) for message in messages)
        return [group for group in groups if group is not None]


def _group(message: str) -> Mapping[str, float | None] | None:
    """A group of measurements: ``##1:7306 | 1887 | [mfault]``; None: another message, or a garbled one."""
    found = _GROUP.fullmatch(message.strip(" \r\n\x02"))
    if found is None or (names := GROUPS.get(int(found[1]))) is None:
        return None
    values = [text.strip() for text in found[2].split("|")]
    if len(values) != len(names) or not all(_VALUE.fullmatch(value) and _fits(value) for value in values):
        return None
    return {name: _measured(value) for name, value in zip(names, values, strict=True)}


def _measured(value: str) -> float | None:
    """A value as a number: inf beyond the sensor's range, None where there is none."""
    if value.startswith("["):
        return math.inf if value in _BEYOND else None
    return int(value)


def _fits(value: str) -> bool:
    """Whether a value has 16 bits, or is none."""
    return value.startswith("[") or int(value) <= 0xFFFF
