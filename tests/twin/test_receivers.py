"""Servo and motor controller: which command a pulse is to them."""

import pytest

from tral_env.hardware.calibration_file import load_calibration
from tral_env.twin.receivers import ARMING_S, MotorController, Servo

CAR = load_calibration("tt01")


@pytest.mark.parametrize(("us", "command"), [(1240, 1.0), (1530, 0.0), (1810, -1.0), (1385, 0.5), (1000, 1.0)])
def test_the_servo_takes_pulses_as_its_calibration_says(us: float, command: float) -> None:
    assert Servo(CAR).hear(us) == pytest.approx(command)


def test_the_servo_stays_where_it_is_without_pulses() -> None:
    servo = Servo(CAR)
    servo.hear(1240)
    assert [servo.hear(0.0), servo.hear(17000.0)] == [1.0, 1.0]


def test_a_reversed_servo_turns_the_other_way() -> None:
    servo = Servo(CAR)
    servo.reversed = True
    assert servo.hear(1540) == pytest.approx(10 / 290)  # 10 us to the right of the middle is 10 us to the left


def hears(controller: MotorController, us: float, begun_s: float, seconds: float) -> float:
    controller.hear(us, begun_s)
    return controller.hear(us, begun_s + seconds)


def test_the_controller_drives_after_neutral_has_stood() -> None:
    controller = MotorController(CAR)
    assert hears(controller, 1140, 0.0, 1.0) == 0.0
    assert hears(controller, 1530, 2.0, ARMING_S / 2) == 0.0
    assert hears(controller, 1140, 3.0, 1.0) == 0.0
    hears(controller, 1570, 5.0, ARMING_S)  # within the dead zone
    assert [hears(controller, us, 6.0, 0.1) for us in (1140, 1860, 1335)] == pytest.approx([1.0, -1.0, 0.5])


def test_without_pulses_it_lets_go_and_stays_armed() -> None:
    controller = MotorController(CAR)
    hears(controller, 1530, 0.0, ARMING_S)
    assert controller.hear(0.0, 1.0) == 0.0
    assert controller.hear(1140, 1.1) == 1.0


def test_a_power_cycle_or_a_fault_disarms_it() -> None:
    controller = MotorController(CAR)
    hears(controller, 1530, 0.0, ARMING_S)
    controller.power_cycle()
    assert controller.hear(1140, 1.0) == 0.0
    controller.refuses = True
    hears(controller, 1530, 2.0, ARMING_S)
    assert controller.hear(1140, 3.0) == 0.0
