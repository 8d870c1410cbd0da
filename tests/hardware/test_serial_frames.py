"""What the serial boards say is found in any bytes, in pieces of any size; noise is passed over."""

from __future__ import annotations

import math
import struct
from random import Random

import pytest

from tral_env.hardware.serial_frames import FrameParser, SerialFrame, TextParser

FRAME = SerialFrame(front=310, right=80, left=45, line=0x18, hall=937, battery=7200)


def wire(frame: SerialFrame = FRAME) -> bytes:
    return b"\x00\x0f" + struct.pack("<HHHBHH", *frame)


def fed(parser: FrameParser | TextParser, data: bytes, size: int) -> list[object]:
    return [found for at in range(0, len(data), size) for found in parser.feed(data[at : at + size])]


@pytest.mark.parametrize("size", [1, 2, 5, 13, 100])
def test_frames_are_found_in_pieces_of_any_size(size: int) -> None:
    frames = [FRAME._replace(hall=count) for count in range(5)]
    assert fed(FrameParser(), b"".join(map(wire, frames)) + b"\x00\x0f", size) == frames


def test_a_first_frame_waits_for_the_header_of_the_next_and_later_ones_do_not() -> None:
    parser = FrameParser()
    assert parser.feed(wire()) == []
    assert parser.feed(b"\x00\x0f") == [FRAME]
    assert parser.feed(wire()[2:]) == [FRAME]


def test_a_parser_in_step_does_not_take_a_header_within_the_data_for_one() -> None:
    within = FRAME._replace(right=0x0F00, hall=0x0F00)
    assert FrameParser().feed(wire() + wire(within) * 3) == [FRAME, *[within] * 3]


@pytest.mark.parametrize("lost", range(13))
def test_after_a_lost_byte_the_parser_finds_the_step_again(lost: int) -> None:
    parser = FrameParser()
    broken = wire()[:lost] + wire()[lost + 1 :]
    found = parser.feed(wire() * 2 + broken + wire() * 3)
    assert found[:2] == [FRAME] * 2
    assert found[-1] == FRAME
    assert len(found) in (4, 5, 6)


def test_groups_are_found_among_answers_and_line_ends() -> None:
    said = b"\x02:ok\x03\n##1:7306 | 1887 | 3655\x03\n:F 300\x03'ERR(3): low\x03##2:17 | 250\x03\r\n##3:7200\x03##1:1"
    for size in (1, 3, 1000):
        assert fed(TextParser(), said, size) == [
            {"USL": 7306, "USF": 1887, "USR": 3655},
            {"HALL_CNT": 17, "HALL_DT": 250},
            {"VDBAT": 7200},
        ]


def test_a_value_that_the_board_does_not_have_is_none() -> None:
    assert TextParser().feed(b"##1:[---] | 1887 | [mfault]\x03") == [{"USL": None, "USF": 1887, "USR": None}]


def test_a_value_beyond_the_sensors_range_is_infinite() -> None:
    assert TextParser().feed(b"##1:[over] | 0 | [range]\x03") == [{"USL": math.inf, "USF": 0, "USR": math.inf}]


@pytest.mark.parametrize(
    "garbled",
    [
        b"##1:7306 | 1887",
        b"##1:7306 | 1887 | 3655 | 1",
        b"##1:7306 | -887 | 3655",
        b"##1:7306 | 1e3 | 3655",
        b"##1:7306 | 65536 | 3655",
        b"##1:7306 |  | 3655",
        b"##7:7306",
        b"##:7306",
        b"#028A1C5F07470E",
        b"##3:72\xb200",
        b"##3:\xd9\xa1",
    ],
)
def test_a_garbled_group_is_passed_over(garbled: bytes) -> None:
    assert TextParser().feed(garbled + b"\x03##3:7200\x03") == [{"VDBAT": 7200}]


def test_a_message_without_an_end_takes_no_more_memory() -> None:
    parser = TextParser()
    for _ in range(100):
        assert parser.feed(b"#" * 4096) == []
    assert parser.feed(b"\x03##3:7200\x03") == [{"VDBAT": 7200}]


def streams(count: int) -> list[bytes]:
    """Byte streams, the same at each run: noise, noise that likes headers and ends, and true ones that are damaged."""
    random, found = Random(18), []
    text = b"##1:7306 | 1887 | 3655\x03##2:17 | 250\x03"
    for number in range(count):
        size = random.randrange(1, 80)
        if number % 4 == 0:
            stream = random.randbytes(size)
        elif number % 4 == 1:
            stream = bytes(random.choices(b"\x00\x0f\x03\x02#123:| []", k=size))
        else:
            damaged = bytearray(wire() * 3 if number % 4 == 2 else text * 2)
            for _ in range(random.randrange(1, 6)):
                damaged[random.randrange(len(damaged))] = random.randrange(256)
            del damaged[random.randrange(len(damaged))]
            stream = bytes(damaged)
        found.append(stream)
    return found


def test_20000_random_streams_raise_nothing_and_give_values_of_16_bits() -> None:
    frames, texts, random = FrameParser(), TextParser(), Random(19)
    for stream in streams(20_000):
        at = random.randrange(len(stream))
        for piece in (stream[:at], stream[at:]):
            for frame in frames.feed(piece):
                assert all(0 <= value <= 0xFFFF for value in frame)
            for group in texts.feed(piece):
                assert all(value in (None, math.inf) or 0 <= value <= 0xFFFF for value in group.values())
