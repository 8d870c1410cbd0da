"""Serial boards on pseudo-terminals that pyserial opens."""

import random
from pathlib import Path
from typing import Any

import pytest

from tral_env.hardware.calibration_file import load_calibration
from tral_env.twin.serial_boards import SimulatedBoard2016, SimulatedUcboard
from tral_env.twin.serial_port import SerialPort, parts, spoiled

from test_twin_serial_boards import READINGS  # isort: skip

serial = pytest.importorskip("serial")


def turns(port: SerialPort, count: int, begun_s: float = 0.0) -> None:
    for k in range(count):
        port.turn(READINGS, begun_s + k * 0.0125)


def opened(port: SerialPort) -> Any:
    return serial.Serial(str(port.path), port.board.baud, timeout=0.5)


def test_pyserial_reads_frames_that_come_in_parts(tmp_path: Path) -> None:
    port = SerialPort(tmp_path / "tty", SimulatedBoard2016(load_calibration("tt01")), seed=1)
    with opened(port) as reader:
        turns(port, 40)
        data = reader.read(13 * 20)
    board = SimulatedBoard2016(load_calibration("tt01"))
    first, later = board.speak(READINGS, 0.0), board.speak(READINGS, 1.0)
    assert data == first + later * 19
    port.unplug()


def test_commands_reach_the_board(tmp_path: Path) -> None:
    board = SimulatedUcboard(load_calibration("tt01"))
    port = SerialPort(tmp_path / "tty", board, seed=1)
    with opened(port) as writer:
        writer.write(b"!STEER -300\n")
        turns(port, 4)
        assert writer.read_until(b"\x03") == b"\x02:-300\x03"
    assert board.steering == -300
    port.unplug()


def test_an_unplugged_port_is_an_error_and_may_come_back(tmp_path: Path) -> None:
    port = SerialPort(tmp_path / "tty", SimulatedBoard2016(load_calibration("tt01")), seed=1)
    with opened(port) as reader:
        port.unplug()
        port.unplug()
        turns(port, 2)
        assert not (tmp_path / "tty").exists()
        with pytest.raises(serial.SerialException):
            reader.read(13)
    port.plug_in()
    port.plug_in()
    with opened(port) as reader:
        turns(port, 4)
        assert len(reader.read(13)) == 13
    port.unplug()


def test_garbage_spoils_some_bytes(tmp_path: Path) -> None:
    port = SerialPort(tmp_path / "tty", SimulatedBoard2016(load_calibration("tt01")), seed=1)
    port.garbage = True
    with opened(port) as reader:
        turns(port, 80)
        data = reader.read(2000)
    board = SimulatedBoard2016(load_calibration("tt01"))
    board.speak(READINGS, 0.0)
    assert 5 < data.count(board.speak(READINGS, 1.0)) < 45
    port.unplug()


def test_what_nobody_reads_is_lost(tmp_path: Path) -> None:
    port = SerialPort(tmp_path / "tty", SimulatedBoard2016(load_calibration("tt01")), seed=1)
    turns(port, 2000)  # more than a port keeps
    with opened(port) as reader:
        turns(port, 40, 25.0)
        assert reader.read(13), "who comes later hears what is new"
    port.unplug()


def test_spoiled_bytes_keep_their_share() -> None:
    rng = random.Random(3)
    data = bytes(10_000)
    assert spoiled(data, rng, share=1e-9) == data
    lost, changed, extra = 0.05 / 3, 0.05 / 3, 0.05 / 3
    found = spoiled(data, rng)
    assert len(found) == pytest.approx(10_000 * (1 - lost + extra), rel=0.01)
    assert 10_000 * (changed + extra) * 0.7 < len(found) - found.count(0) < 10_000 * (changed + extra) * 1.3


def test_parts_are_the_whole_in_order() -> None:
    rng = random.Random(3)
    cut = [parts(b"abcdef", rng) for _ in range(50)]
    assert {now + later for now, later in cut} == {b"abcdef"}
    assert len({now for now, _ in cut}) > 3
