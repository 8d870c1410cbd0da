"""Whatever the board, and however servo and motor are mounted: after the step direction, a drive goes left and forward.

A person at the bench sees the car move, and answers what is true.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path

import pytest
from workbench import Script, Workbench, car_file

from tral_env.hardware.actuator import serial_boards
from tral_env.hardware.actuator.drivers import BOARDS, open_driver, takes_commands
from tral_env.hardware.actuator.laws import pulse_us
from tral_env.hardware.actuator.settings import Settings
from tral_env.hardware.bringup.guide import calibrate
from tral_env.hardware.bringup.steps import needed_steps
from tral_env.hardware.bringup.template import car_text
from tral_env.hardware.car_file import CarFile, load_car, parse_car

SERIAL = ("board2016", "ucboard")
Moved = tuple[float, float]
"""Shares of full lock to the left and of full throttle forward, as the wheels show them."""


def file_text(board: str) -> str:
    text = car_text(board=board, sensors=(), camera=False)
    return text.replace("clock_measured = false", "clock_measured = true")


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """What was written to the serial port."""
    sent: list[bytes] = []
    monkeypatch.setattr(serial_boards, "open_port", lambda port, baud: object())
    monkeypatch.setattr(serial_boards, "write_at_once", lambda port, data: sent.append(data))
    return sent


class Car:
    """Servo and motor behind a board, each of which may be mounted the other way round."""

    def __init__(self, line: list[bytes], servo: int, motor: int) -> None:
        self._line, self._servo, self._motor = line, servo, motor

    def moves(self, settings: Settings, pulses: tuple[float, float]) -> Moved:
        """What the wheels do as the board gets pulses from the worker."""
        if settings.driver in SERIAL:
            driver = open_driver(settings)
            self._line.clear()
            driver.set_pulses(*pulses)
            left, forward = _said(settings.driver, b"".join(self._line))
        else:
            left, forward = (pulses[0] - 1530) / 290, (1530 - pulses[1]) / 390
        return left * self._servo, forward * self._motor

    def drive(self, car: CarFile, steering: float, throttle: float) -> Moved:
        """What the wheels do at a command of a drive."""
        settings = car.settings
        return self.moves(settings, (pulse_us(steering, settings.steering), pulse_us(throttle, settings.throttle)))


def _said(board: str, sent: bytes) -> Moved:
    """Steering and throttle as the boards' manuals read them."""
    if board == "board2016":
        motor, steering = sent
        return (50 - steering) / 50, (motor - 0x8A) / 10
    words = sent.decode().split()
    return -int(words[1]) / 1000, int(words[-1]) / 1000 * (-1 if words[-3] == "B" else 1)


def calibrated(folder: Path, car: Car, board: str) -> tuple[CarFile, list[Moved]]:
    """The car file after the step `direction`, and all that moved on the bench."""
    bench, moved = Workbench(), list[Moved]()

    def seen(part: int) -> Callable[[], str]:
        def answer() -> str:
            opened = bench.opened[-1]
            moved.extend(car.moves(opened.settings, each) for each in bench.pulses if each != (0.0, 0.0))
            last = next(each[part] for each in reversed(moved) if abs(each[part]) > 0.01)
            return "y" if last > 0.0 else "n"

        return answer

    path = car_file(folder, file_text(board))
    calibrate(path, Script([seen(0), seen(1)]).person, bench.bench, ["direction"])
    assert bench.rests
    return load_car(path), moved


@pytest.mark.parametrize(("servo", "motor"), list(product((1, -1), repeat=2)))
@pytest.mark.parametrize("board", BOARDS)
def test_after_the_step_direction_a_drive_goes_left_and_forward(
    tmp_path: Path, line: list[bytes], board: str, servo: int, motor: int
) -> None:
    car = Car(line, servo, motor)
    file, _ = calibrated(tmp_path, car, board)
    left, forward = car.drive(file, 1.0, 0.3)
    assert left > 0.9
    assert forward > 0.1
    right, backward = car.drive(file, -1.0, -0.3)
    assert right < -0.9
    assert backward < -0.1


@pytest.mark.parametrize("board", BOARDS)
def test_what_the_bench_sends_for_left_and_forward_is_what_a_drive_sends(
    tmp_path: Path, line: list[bytes], board: str
) -> None:
    car = Car(line, 1, 1)
    before = parse_car(file_text(board))
    _, moved = calibrated(tmp_path, car, board)
    wanted = {car.drive(before, *each) for each in ((0.0, 0.0), (1.0, 0.0), (0.0, 0.1))}
    assert {(round(left, 2), round(forward, 2)) for left, forward in moved} == {
        (round(left, 2) + 0.0, round(forward, 2) + 0.0) for left, forward in wanted
    }


@pytest.mark.parametrize("board", SERIAL)
def test_no_pulse_is_asked_for_where_the_board_makes_them(board: str) -> None:
    car = parse_car(file_text(board))
    assert takes_commands(car.board.options)
    assert needed_steps(car) == ("direction", "arming")


@pytest.mark.parametrize("board", SERIAL)
def test_a_direction_that_was_turned_round_is_turned_back_by_the_next_no(
    tmp_path: Path, line: list[bytes], board: str
) -> None:
    assert line == []
    path, bench = car_file(tmp_path, file_text(board)), Workbench()
    for turned in (True, False):
        script = Script(["n", "n"])
        calibrate(path, script.person, bench.bench, ["direction"])
        options = load_car(path).board.options
        assert (options.steering_reversed, options.throttle_reversed) == (turned, turned)  # type: ignore[attr-defined]
        assert "  the board gets each throttle with the other sign from now on" in script.told


@pytest.mark.parametrize("board", SERIAL)
def test_on_the_bench_a_board_that_takes_commands_has_a_narrow_throttle(
    tmp_path: Path, line: list[bytes], board: str
) -> None:
    assert line == []
    bench, path = Workbench(), car_file(tmp_path, file_text(board))
    calibrate(path, Script(["", "y"]).person, bench.bench, ["arming"])
    (opened,) = bench.opened
    assert (opened.settings.limits.max_throttle, opened.settings.limits.max_reverse) == (0.3, 0.3)
    assert min(throttle for _, throttle in bench.pulses if throttle) == pytest.approx(1530 - 0.3 * 390)
