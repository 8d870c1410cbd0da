"""The two serial boards: what they send, what they take."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.hardware.calibration_file import load_calibration
from tral_env.interface import NO_ECHO_M
from tral_env.twin.serial_boards import BoardReadings, SimulatedBoard2016, SimulatedUcboard

CAR = load_calibration("tt01")
READINGS = BoardReadings(
    range_m={"left": 0.7306, "front": 1.25, "right": NO_ECHO_M},
    ranging=1,
    ticks=300,
    spacing_s=0.0251,
    turn_s=0.2,
    battery_v=7.4,
    line=0x18,
)


def test_a_frame_of_2016_has_13_bytes_low_byte_first() -> None:
    frame = SimulatedBoard2016(CAR).speak(READINGS, 0.0)
    hall = int(300 * 0.02513 * 937.5)
    assert frame == bytes([0x00, 0x0F, 125, 0, 0, 0, 73, 0, 0x18, hall & 0xFF, hall >> 8, 7400 & 0xFF, 7400 >> 8])


def test_a_range_of_2016_stands_in_one_frame_alone() -> None:
    board = SimulatedBoard2016(CAR)
    frames = [board.speak(replace(READINGS, ranging=k // 2), k * 0.02) for k in range(4)]
    assert [frame[2] for frame in frames] == [125, 0, 125, 0]


def test_the_hall_count_of_2016_goes_round() -> None:
    frame = SimulatedBoard2016(CAR).speak(replace(READINGS, ticks=3000), 0.0)
    assert int.from_bytes(frame[9:11], "little") == int(3000 * 0.02513 * 937.5) % 65536


def test_a_frame_of_2016_comes_every_20_ms() -> None:
    board = SimulatedBoard2016(CAR)
    sent = [bool(board.speak(READINGS, k * 0.01)) for k in range(6)]
    assert sent == [True, False, True, False, True, False]


def test_bytes_of_2016_are_levels_of_motor_and_steering() -> None:
    board = SimulatedBoard2016(CAR)
    assert board.pulses_us(0.0) == (1530.0, 1530.0)
    assert board.hear(bytes([0x80 + 10 + 10, 50 + 50]), 0.0) == b""
    assert board.pulses_us(0.0) == (1810.0, 1140.0)  # full right, full forward
    board.hear(bytes([0x80 + 10 - 10, 50 - 25]), 0.0)
    assert board.pulses_us(0.0) == (1385.0, 1860.0)


def test_levels_beyond_the_scale_are_ignored() -> None:
    board = SimulatedBoard2016(CAR)
    board.hear(bytes([0xFF, 0x7F]), 0.0)
    assert (board.motor_level, board.steering_level) == (0, 0)


def said(board: SimulatedUcboard, *lines: str, now_s: float = 0.0) -> list[str]:
    answer = board.hear("".join(f"{line}\n" for line in lines).encode(), now_s).decode()
    return [part.removeprefix("\x02") for part in answer.split("\x03\n")[:-1]]


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("!DRV F 300", ":F 300"),
        ("!drv f 300 300", ":F 300"),
        ("!DRV F 300 301", ":ERR(269): Message corrupted! (The two values have to be equal!)"),
        ("!DRV F 1001", ":ERR(258):Out of range!"),
        ("!DRV B 500", ":B 500"),
        ("!DRV OFF", ":OFF"),
        ("!DRV ~DMS=1000", ":~DMS=1000"),
        ("!DRV", ":ok"),
        ("!DRV X 1", ":ERR(258):Out of range!"),
        ("!DRV F x", ":ERR(257):Wrong arguments!"),
        ("?DRV ~DMS", ":OFF ~DMS=0"),
        ("!STEER -200", ":-200"),
        ("!STEER -200 -201", ":ERR(269): Message corrupted! (The two values have to be equal!)"),
        ("!STEER 1001", ":ERR(258):Out of range!"),
        ("?STEER", ":0"),
        ("!US OFF", ":OFF"),
        ("?US", ":ON"),
        ("?ID", ":4"),
        ("?VER", ":0.1.0"),
        ("!SID 7", ":7"),
        ("?TICS", ":0"),
        ("!DAQ START", ":started"),
        ("?DAQ", ":stopped"),
        ("!DAQ GRP 1 ~ANY USL USF", ":ok"),
        ("!DAQ GRP 20 USL", ":ERR(258):Out of range!"),
        ("!DAQ GRP 1 USL ~ENC=B64", ":ERR(259):Not supported!"),
        ("!DAQ GRP 1 ~ACTIVATE", ":ERR(257):Wrong arguments!"),
        ("!DAQ GRP 1 ~DELETE", ":ok"),
        ("?DAQ GET USF", ":[---]"),
        ("hello", ":ERR(256):Unknown command!"),
        ("!", ":ERR(256):Unknown command!"),
    ],
)
def test_each_command_of_the_ucboard_has_its_answer(line: str, answer: str) -> None:
    assert said(SimulatedUcboard(CAR), line) == [answer]


def test_a_line_may_come_in_parts() -> None:
    board = SimulatedUcboard(CAR)
    assert board.hear(b"!STEER ", 0.0) == b""
    assert board.hear(b"-200\n?ST", 0.0) == b"\x02:-200\x03\n"


def test_set_points_of_the_ucboard_are_pulses() -> None:
    board = SimulatedUcboard(CAR)
    assert board.pulses_us(0.0) == (1530.0, 0.0)  # switched off
    said(board, "!STEER 1000", "!DRV F 1000")
    assert board.pulses_us(0.0) == (1810.0, 1140.0)
    said(board, "!DRV F -500")
    assert board.pulses_us(0.0)[1] == 1860.0
    said(board, "!DRV B 250")
    assert board.pulses_us(0.0)[1] == 1695.0
    said(board, "!DRV D -100")
    assert board.pulses_us(0.0)[1] == 1400.0


def test_the_dead_mans_switch_stops_the_motor_until_the_next_command() -> None:
    board = SimulatedUcboard(CAR)
    said(board, "!DRV ~DMS=500", "!DRV F 1000")
    assert board.pulses_us(0.5)[1] == 1140.0
    assert board.pulses_us(0.51)[1] == 1530.0
    said(board, "!DRV", now_s=0.6)
    assert board.pulses_us(0.7)[1] == 1140.0


def test_groups_are_sent_when_they_have_new_values() -> None:
    board = SimulatedUcboard(CAR)
    said(board, "!DAQ GRP 1 ~ALL=20 USL USF USR", "!DAQ GRP 2 ~ANY HALL_CNT HALL_DT")
    assert board.speak(READINGS, 0.0) == b""
    said(board, "!DAQ START")
    assert board.speak(READINGS, 0.0) == b"\x02##1:7306 | 12500 | [over]\x03\n\x02##2:44 | 251\x03\n"
    assert board.speak(READINGS, 0.01) == b""
    assert board.speak(replace(READINGS, ticks=301), 0.02) == b"\x02##2:45 | 251\x03\n"
    assert board.speak(replace(READINGS, ticks=301, ranging=2), 0.03).startswith(b"\x02##1:")
    said(board, "!US OFF", "!DAQ GRP 2 ~DEACTIVATE")
    assert board.speak(replace(READINGS, ranging=3), 0.04) == b"\x02##1:[---] | [---] | [---]\x03\n"


def test_groups_may_be_sent_in_a_cadence() -> None:
    board = SimulatedUcboard(CAR)
    said(board, "!DAQ GRP 3 ~TS=20 VDBAT HALL_DT8 AX", "!DAQ START")
    sent = [board.speak(READINGS, k * 0.01) for k in range(4)]
    assert sent == [b"\x02##3:7400 | 200 | [---]\x03\n", b""] * 2
    assert said(board, "?DAQ GET USL VDBAT") == [":7306 | 7400"]


@given(st.lists(st.binary(max_size=40), max_size=20))
def test_no_bytes_make_a_board_fail(parts: list[bytes]) -> None:
    for board in (SimulatedBoard2016(CAR), SimulatedUcboard(CAR)):
        for data in parts:
            board.hear(data, 0.0)
            board.speak(READINGS, 0.0)
            assert all(us == 0.0 or 1000.0 <= us <= 2000.0 for us in board.pulses_us(0.0))
