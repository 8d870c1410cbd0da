"""What the worker tells the two serial boards, byte for byte and line for line."""

from __future__ import annotations

import math
import os
import pty
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import pytest
from rig import SETTINGS

from tral_env.errors import ConfigError, HardwareError, MissingExtraError
from tral_env.hardware.actuator import serial_boards
from tral_env.hardware.actuator.drivers import open_driver
from tral_env.hardware.actuator.laws import pulse_us
from tral_env.hardware.actuator.serial_boards import Board2016Options, UcboardOptions
from tral_env.hardware.actuator.settings import Settings
from tral_env.hardware.serial_port import open_port, write_at_once


class Line:
    """A serial line: a pipe, so that what was written is there at once."""

    def __init__(self) -> None:
        self.opened = 0
        self.refuses = False
        self._ends = [os.pipe2(os.O_NONBLOCK)]

    def open(self, port: str, baud: int) -> Line:
        """Open the port once more, with a new plug."""
        del port, baud
        self.opened += 1
        if self.opened > 1:
            self._ends.append(os.pipe2(os.O_NONBLOCK))
        return self

    def write(self, port: Line, data: bytes) -> None:
        """Write as a driver does, unless the line takes nothing now."""
        if self.refuses:
            raise BlockingIOError
        write_at_once(port, data)

    def fileno(self) -> int:
        return self._ends[-1][1]

    def close(self) -> None:
        """Close the port; nothing to do for a pipe."""

    def unplug(self) -> None:
        reader, writer = self._ends.pop()
        os.close(reader)
        self._ends.append((os.open("/dev/null", os.O_RDONLY), writer))

    def heard(self) -> bytes:
        """All that the driver has sent since the last time."""
        try:
            return os.read(self._ends[-1][0], 65536)
        except BlockingIOError:
            return b""

    def lines(self) -> list[str]:
        return self.heard().decode("ascii").splitlines()

    def end(self) -> None:
        for ends in self._ends:
            for end in ends:
                os.close(end)


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> Iterator[Line]:
    made = Line()
    monkeypatch.setattr("tral_env.hardware.actuator.serial_boards.open_port", made.open)
    monkeypatch.setattr("tral_env.hardware.actuator.serial_boards.write_at_once", made.write)
    yield made
    made.end()


def driver(name: str, port: str = "/dev/ttyUSB0", **options: bool) -> Any:
    settings = replace(SETTINGS, driver=name, bus=port, options={"port": port, **options})
    return open_driver(Settings.from_json(settings.to_json()))


def command(board: Any, steering: float, throttle: float) -> None:
    board.set_pulses(pulse_us(steering, SETTINGS.steering), pulse_us(throttle, SETTINGS.throttle))


@pytest.mark.parametrize(
    ("steering", "throttle", "sent"),
    [
        (0.0, 0.0, [0x80 + 10, 50]),
        (1.0, 1.0, [0x80 + 20, 0]),
        (-1.0, -1.0, [0x80, 100]),
        (0.5, 0.26, [0x80 + 12, 25]),
    ],
)
def test_the_board_of_2016_gets_a_byte_for_the_motor_and_one_for_the_steering(
    line: Line, steering: float, throttle: float, sent: list[int]
) -> None:
    command(driver("board2016"), steering, throttle)
    assert list(line.heard()) == sent


def test_the_board_of_2016_has_no_more_rest_than_neutral(line: Line) -> None:
    board = driver("board2016")
    board.start()
    board.off()
    assert board.check() == ""
    assert list(line.heard()) == [0x8A, 50] * 2


def random_pulses() -> Iterator[tuple[float, float]]:
    """Pulses near and far, the same at each run."""
    random = Random(18)
    for _ in range(2000):
        yield (
            random.gauss(1500.0, 400.0),
            random.choice((random.gauss(1500.0, 400.0), 1e300, -1e300, math.inf, -math.inf)),
        )


def test_no_pulse_makes_a_byte_that_means_something_else(line: Line) -> None:
    board = driver("board2016")
    for pulses in random_pulses():
        board.set_pulses(*pulses)
    sent = line.heard()
    assert len(sent) == 4000
    assert all(0x80 <= motor <= 0x80 + 20 for motor in sent[::2])
    assert all(0 <= steering <= 100 for steering in sent[1::2])


def test_the_ucboard_is_set_up_in_neutral_with_its_dead_mans_switch_first(line: Line) -> None:
    driver("ucboard").start()
    assert line.lines() == [
        "!DRV ~DMS=500",
        "!STEER 0 0",
        "!DRV F 0 0",
        "!DAQ STOP",
        "!US ON",
        "!DAQ GRP 1 ~ALL=20 USL USF USR",
        "!DAQ GRP 2 ~ANY HALL_CNT HALL_DT",
        "!DAQ GRP 3 ~ANY VDBAT",
        "!DAQ START",
    ]


def test_the_ucboard_gets_each_number_twice_and_steers_right_for_plus(line: Line) -> None:
    command(driver("ucboard"), 0.25, 0.3)
    assert line.lines() == ["!STEER -250 -250", "!DRV F 300 300"]


def test_the_ucboard_brakes_after_forward_and_reverses_only_after_neutral(line: Line) -> None:
    board = driver("ucboard")
    for throttle in (0.5, 0.0, -0.5, -1.0, 0.0, -0.5, 0.2, -0.2):
        command(board, 0.0, throttle)
    assert [each for each in line.lines() if "DRV" in each] == [
        "!DRV F 500 500",
        "!DRV F 0 0",
        "!DRV F -250 -250",
        "!DRV F -500 -500",
        "!DRV F 0 0",
        "!DRV B 250 250",
        "!DRV F 200 200",
        "!DRV F -100 -100",
    ]


def test_a_ucboard_that_was_switched_off_has_forgotten_that_it_went_forward(line: Line) -> None:
    board = driver("ucboard")
    command(board, 0.0, 1.0)
    board.off()
    command(board, 0.0, -0.1)
    assert [each for each in line.lines() if "DRV" in each][1:] == ["!DRV OFF", "!DRV B 50 50"]


def test_a_check_sets_the_dead_mans_switch_again(line: Line) -> None:
    board = driver("ucboard")
    assert board.check() == ""
    assert line.lines() == ["!DRV ~DMS=500"]


def test_no_pulse_makes_a_number_beyond_those_of_the_ucboard(line: Line) -> None:
    board = driver("ucboard")
    for pulses in random_pulses():
        board.set_pulses(*pulses)
        for words in map(str.split, line.lines()):
            low, high = {"!STEER": (-1000, 1000), "F": (-500, 1000), "B": (0, 500)}[words[-3].removeprefix("!DRV ")]
            assert low <= int(words[-1]) == int(words[-2]) <= high


@pytest.mark.parametrize("share", [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
@pytest.mark.parametrize(("beside", "lost"), [(0.0, 0), (0.05, 0), (0.0999, 0), (-0.001, 1)])
def test_no_throttle_is_rounded_up_beyond_the_limit_of_the_throttle(
    line: Line, share: float, beside: float, lost: int
) -> None:
    """A limit of 0.35 lies between two levels of the board: the lower one is sent, in both directions."""
    board, told = driver("board2016"), min(share + beside, 1.0)
    command(board, 0.0, told)
    command(board, 0.0, -told)
    level = round(share * 10) - lost
    assert list(line.heard()[::2]) == [0x8A + level, 0x8A - level]


def test_the_ucboard_rounds_a_throttle_toward_rest(line: Line) -> None:
    board = driver("ucboard")
    for throttle in (0.3009, -0.3039):
        board.off()
        command(board, 0.0, throttle)
    assert [each for each in line.lines() if each[5:6] in "FB"] == ["!DRV F 300 300", "!DRV B 151 151"]


@pytest.mark.parametrize(
    ("option", "sent"), [("steering_reversed", [0x8A + 5, 100]), ("throttle_reversed", [0x8A - 5, 0])]
)
def test_a_reversed_board_of_2016_gets_the_other_sign(line: Line, option: str, sent: list[int]) -> None:
    command(driver("board2016", **{option: True}), 1.0, 0.5)
    assert list(line.heard()) == sent


def test_a_reversed_ucboard_drives_by_its_other_direction_and_coasts_for_a_brake(line: Line) -> None:
    board = driver("ucboard", steering_reversed=True, throttle_reversed=True)
    command(board, 0.25, 0.0)
    for throttle in (0.5, -0.5, 0.0, -0.5):
        command(board, 0.0, throttle)
    sent = line.lines()
    assert sent[:2] == ["!STEER 250 250", "!DRV F 0 0"]
    assert [each for each in sent[2:] if "DRV" in each] == [
        "!DRV B 250 250",
        "!DRV F 0 0",
        "!DRV F 0 0",
        "!DRV F 250 250",
    ]


@pytest.mark.parametrize("name", ["board2016", "ucboard"])
def test_a_port_that_was_lost_is_opened_anew_and_gets_neutral_before_any_command(line: Line, name: str) -> None:
    board = driver(name)
    board.start()
    neutral = line.heard()
    line.unplug()
    with pytest.raises(BrokenPipeError):
        command(board, 0.0, 0.5)
    with pytest.raises(OSError, match="/dev/ttyUSB0 was opened anew, and the board was set up in neutral"):
        command(board, 0.0, 0.5)
    assert line.opened == 2
    assert line.heard() == neutral, "neutral alone, and the dead man's switch with it"
    command(board, 0.0, 0.5)
    assert line.heard() in (bytes([0x8F, 50]), b"!STEER 0 0\n!DRV F 500 500\n")


def test_a_port_that_was_opened_anew_and_takes_no_neutral_gets_nothing_else(line: Line) -> None:
    board = driver("board2016")
    line.unplug()
    with pytest.raises(BrokenPipeError):
        board.start()
    line.refuses = True
    with pytest.raises(BlockingIOError):
        command(board, 0.0, 0.5)
    line.refuses = False
    with pytest.raises(OSError, match="was opened anew"):
        command(board, 0.0, 0.5)
    assert line.opened == 3
    assert list(line.heard()) == [0x8A, 50]


def test_the_ucboard_never_reverses_before_it_got_neutral_after_the_brake(line: Line) -> None:
    board = driver("ucboard")
    command(board, 0.0, 0.5)
    command(board, 0.0, -0.5)
    line.heard()
    line.refuses = True
    for _ in range(3):
        with pytest.raises(BlockingIOError):
            command(board, 0.0, 0.0)
    with pytest.raises(BlockingIOError):
        board.off()
    line.refuses = False
    command(board, 0.0, -0.5)
    assert line.lines()[1] == "!DRV F -250 -250"


def test_a_forward_that_may_have_reached_the_ucboard_is_braked(line: Line) -> None:
    board = driver("ucboard")
    line.refuses = True
    with pytest.raises(BlockingIOError):
        command(board, 0.0, 0.5)
    line.refuses = False
    command(board, 0.0, -0.5)
    assert line.lines()[1] == "!DRV F -250 -250"


def test_a_port_that_takes_nothing_now_fails_and_stays_open(line: Line) -> None:
    board = driver("board2016")
    with suppress(BlockingIOError):
        while True:
            os.write(line.fileno(), bytes(4096))
    with pytest.raises(BlockingIOError):
        board.start()
    while line.heard():
        pass
    board.start()
    assert line.opened == 1


@pytest.mark.usefixtures("line")
def test_a_port_that_takes_a_part_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    board = driver("ucboard")
    monkeypatch.setattr(os, "write", lambda file, data: len(data) - 1)
    with pytest.raises(OSError, match="the serial port took 13 of 14 bytes"):
        board.check()


def test_a_port_that_does_not_come_back_is_an_oserror(
    line: Line, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    board = driver("board2016", str(tmp_path / "gone"))
    monkeypatch.setattr("tral_env.hardware.actuator.serial_boards.open_port", open_port)
    line.unplug()
    with pytest.raises(BrokenPipeError):
        board.start()
    with pytest.raises(HardwareError, match="cannot open the serial port"):
        board.start()


@pytest.mark.usefixtures("line")
def test_a_terminal_is_opened_as_a_port_that_passes_bytes_on_as_they_are() -> None:
    ours, theirs = pty.openpty()
    port = open_port(os.ttyname(theirs), 921600)
    write_at_once(port, b"!\n\x03")
    assert os.read(ours, 16) == b"!\n\x03"
    port.close()
    os.close(ours)
    os.close(theirs)


def test_a_port_that_is_not_there_is_told_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match=r"cannot open the serial port .* Is the board's plug in"):
        Board2016Options(port=str(tmp_path / "tty")).open(SETTINGS)


def test_pyserial_that_is_missing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(MissingExtraError, match="pyserial"):
        UcboardOptions(port="/dev/null").open(SETTINGS)


@pytest.mark.parametrize(
    ("options", "baud"),
    [
        (Board2016Options(port="/dev/ttyUSB0"), 115200),
        (UcboardOptions(port="/dev/ttyUSB0"), 921600),
        (UcboardOptions(port="/dev/ttyUSB0", baud=115200), 115200),
    ],
)
def test_a_port_is_opened_with_the_speed_of_its_board(
    monkeypatch: pytest.MonkeyPatch, options: Board2016Options | UcboardOptions, baud: int
) -> None:
    opened: list[tuple[str, int]] = []
    monkeypatch.setattr(serial_boards, "open_port", lambda *port: opened.append(port))
    options.open(SETTINGS)
    assert opened == [("/dev/ttyUSB0", baud)]


def test_a_baud_rate_that_no_port_has_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"UcboardOptions.baud = 1: expected 1200 to 4e\+06"):
        UcboardOptions(port="/dev/ttyUSB0", baud=1)
