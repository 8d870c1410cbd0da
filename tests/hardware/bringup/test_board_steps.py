"""The guided steps that move the car: what a person is asked, which pulses stand meanwhile, and what is written."""

from __future__ import annotations

from pathlib import Path

import pytest
from workbench import FILE, Script, Workbench, car_file

from tral_env.errors import ConfigError, HardwareError
from tral_env.hardware.bringup.guide import calibrate
from tral_env.hardware.car_file import CarFile, load_car

UNMEASURED = FILE.replace("clock_measured = true", "clock_measured = false")
NEUTRAL = (1530.0, 1530.0)


@pytest.fixture
def bench() -> Workbench:
    return Workbench()


def done(folder: Path, bench: Workbench, step: str, *answers: str, text: str = FILE) -> tuple[CarFile, Script]:
    """Do one step with some answers; the car afterwards."""
    script = Script(answers)
    path = car_file(folder, text)
    calibrate(path, script.person, bench.bench, [step])
    assert bench.rests, "no pulses stand after a step"
    return load_car(path), script


def assert_untouched(folder: Path, bench: Workbench) -> None:
    """Nothing was written, and nothing moves."""
    assert (folder / "car.toml").read_text() == FILE
    assert bench.rests


def test_the_clock_is_measured_in_neutral_with_the_motors_plug_off(tmp_path: Path, bench: Workbench) -> None:
    car, script = done(tmp_path, bench, "clock", "yes", "off", "", "62.2 hz", "y", text=UNMEASURED)
    assert car.calibration.clock_measured
    assert car.calibration.oscillator_hz == pytest.approx(106 * 4096 * 62.2, abs=0.1)
    assert "  the motor must not be connected" in script.said
    assert set(bench.pulses) == {NEUTRAL, (0.0, 0.0)}
    assert len(bench.opened) == 2, "Enter measures once more"
    assert "clock" in car.calibrated


@pytest.mark.parametrize(("answer", "hz"), [("17.37 ms", 24.996e6), ("17,37 MS", 24.996e6), ("17370us", 24.996e6)])
def test_the_period_may_be_told_in_any_unit(tmp_path: Path, bench: Workbench, answer: str, hz: float) -> None:
    car, _ = done(tmp_path, bench, "clock", "off", answer, "y", text=UNMEASURED)
    assert car.calibration.oscillator_hz == pytest.approx(hz, rel=1e-4)


def test_a_period_that_no_board_has_is_asked_for_again(tmp_path: Path, bench: Workbench) -> None:
    answers = ("off", "57.6", "100 hz", "0 hz", "57.6 hz", "n", "57.7 hz", "y")
    car, script = done(tmp_path, bench, "clock", *answers, text=UNMEASURED)
    assert (
        "that would be a clock of 43.42 MHz, and no board has it: expected a period of 14.97 to 19.74 ms" in script.told
    )
    assert car.calibration.oscillator_hz == pytest.approx(106 * 4096 * 57.7, abs=0.1)


@pytest.mark.parametrize("step", ["neutral", "ends", "direction", "dead_zone", "arming"])
def test_nothing_moves_a_motor_from_a_board_whose_clock_was_never_measured(
    tmp_path: Path, bench: Workbench, step: str
) -> None:
    with pytest.raises(ConfigError, match="the clock of the board was never measured"):
        done(tmp_path, bench, step, "y", text=UNMEASURED)
    assert bench.opened == []


def test_neutral_is_moved_until_the_wheels_rest_and_point_straight(tmp_path: Path, bench: Workbench) -> None:
    car, _ = done(tmp_path, bench, "neutral", "+", "--", "1512", "", "+", "")
    throttle, steering = car.calibration.throttle, car.calibration.steering
    assert (throttle.neutral_us, throttle.forward_us, throttle.reverse_us) == (1512, 1122, 1842)
    assert (throttle.min_us, throttle.max_us) == (1122, 1842)
    assert (steering.neutral_us, steering.trim_us) == (1530, 10)
    shown = [pulses for pulses in bench.pulses if pulses not in (NEUTRAL, (0.0, 0.0))]
    assert shown == [(1530.0, 1540.0), (1530.0, 1500.0), (1530.0, 1512.0), (1540.0, 1530.0)]


def test_an_answer_that_means_nothing_or_goes_too_far_is_asked_again(tmp_path: Path, bench: Workbench) -> None:
    car, script = done(tmp_path, bench, "neutral", "left", "1700", "", "")
    assert car.calibration.throttle.neutral_us == 1530
    assert "  'left' is none of + - ++ --, a whole number of us, or Enter" in script.said
    assert "  1700 us is outside of 1430 to 1630 us" in script.said


def test_the_ends_of_the_steering_are_shown_and_those_of_the_motor_are_asked(tmp_path: Path, bench: Workbench) -> None:
    car, _ = done(tmp_path, bench, "ends", "++", "", "-", "", "1160 us", "x", "100", "")
    steering, throttle = car.calibration.steering, car.calibration.throttle
    assert (steering.left_us, steering.right_us, steering.min_us, steering.max_us) == (1280, 1800, 1280, 1800)
    assert (throttle.forward_us, throttle.reverse_us, throttle.min_us, throttle.max_us) == (1160, 1860, 1160, 1860)
    assert all(throttle_us in (1530.0, 0.0) for _, throttle_us in bench.pulses), "the motor rests"


def test_ends_that_cannot_be_are_not_written_and_asked_again(tmp_path: Path, bench: Workbench) -> None:
    car, script = done(tmp_path, bench, "ends", "1700", "", "", "", "", *[""] * 2, *[""] * 2)
    assert "this cannot be" in script.told
    assert "Nothing was written. Once more" in script.told
    assert car.calibration.steering.left_us == 1240


LIMITED = FILE + "[pulses.steering]\nmin_us = 1200\nmax_us = 1850\n[pulses.throttle]\nmax_us = 1900\n"


@pytest.mark.parametrize(
    ("answer", "ends", "limits"), [("y", (1180, 1880), (1180, 1880)), ("n", (1200, 1850), (1200, 1850))]
)
def test_a_hard_limit_of_the_person_is_moved_only_when_they_agree(
    tmp_path: Path, bench: Workbench, answer: str, ends: tuple[int, int], limits: tuple[int, int]
) -> None:
    car, script = done(tmp_path, bench, "ends", "1180", "", "1880", "", "", "", answer, answer, text=LIMITED)
    steering, throttle = car.calibration.steering, car.calibration.throttle
    assert (steering.left_us, steering.right_us) == ends
    assert (steering.min_us, steering.max_us) == limits
    assert (throttle.min_us, throttle.max_us) == (1140, 1900)
    assert script.asked[-2:] == [
        f"An end at {us} us lies beyond the hard limit steering.{name} = {limit} us of the car file. "
        "Move the limit? [y/n/q] "
        for us, name, limit in ((1180, "min_us", 1200), (1880, "max_us", 1850))
    ]


def test_a_hard_limit_of_the_person_that_no_end_passes_stays(tmp_path: Path, bench: Workbench) -> None:
    car, script = done(tmp_path, bench, "ends", *[""] * 4, text=LIMITED)
    assert len(script.asked) == 4
    assert (car.calibration.steering.min_us, car.calibration.steering.max_us) == (1200, 1850)


def test_neutral_moves_no_hard_limit_of_the_person_in_silence(tmp_path: Path, bench: Workbench) -> None:
    text = FILE + "[pulses.throttle]\nmin_us = 1130\n"
    car, _ = done(tmp_path, bench, "neutral", "1512", "", "", "n", text=text)
    throttle = car.calibration.throttle
    assert (throttle.min_us, throttle.forward_us, throttle.reverse_us, throttle.max_us) == (1130, 1130, 1842, 1842)


@pytest.mark.parametrize("left", ["y", "n"])
@pytest.mark.parametrize("forward", ["y", "n"])
def test_a_direction_that_is_wrong_is_turned_round(tmp_path: Path, bench: Workbench, left: str, forward: str) -> None:
    car, _ = done(tmp_path, bench, "direction", left, "0", "", forward)
    steering, throttle = car.calibration.steering, car.calibration.throttle
    assert (steering.left_us, steering.right_us) == ((1240, 1810) if left == "y" else (1810, 1240))
    assert (throttle.forward_us, throttle.reverse_us) == ((1140, 1860) if forward == "y" else (1860, 1140))
    throttles = [throttle for _, throttle in bench.pulses if throttle not in (0.0, 1530.0)]
    assert throttles == pytest.approx([1530 - 390 * share for share in (0.1, 0.15, 0.2)]), "it rises until they turn"


def test_wheels_that_never_turn_are_tried_from_the_beginning(tmp_path: Path, bench: Workbench) -> None:
    _, script = done(tmp_path, bench, "direction", "maybe", "y", *["0"] * 5, "y")
    assert "is the motor's switch on" in script.told
    assert "  'maybe' is none of y, n; q ends, and keeps what was done" in script.said


def test_the_dead_zone_ends_before_the_pulse_that_turns_the_wheels(tmp_path: Path, bench: Workbench) -> None:
    car, _ = done(tmp_path, bench, "dead_zone", "", "n", "", "y")
    assert car.calibration.throttle.dead_zone_us == 15
    tried = [throttle for _, throttle in bench.pulses if throttle not in (0.0, 1530.0)]
    assert tried == [1525.0, 1520.0, 1515.0, 1510.0]


def test_a_motor_that_never_turns_leaves_the_step_undone(tmp_path: Path, bench: Workbench) -> None:
    with pytest.raises(HardwareError, match=r"nothing turned up to 150 us .* is the motor on\?"):
        done(tmp_path, bench, "dead_zone", *["n"] * 30)
    assert_untouched(tmp_path, bench)


def test_arming_takes_the_shortest_neutral_after_which_the_wheels_turn(tmp_path: Path, bench: Workbench) -> None:
    car, _ = done(tmp_path, bench, "arming", "", "n", "", "y")
    assert car.limits.arming_s == 1.5
    assert [each.settings.limits.arming_s for each in bench.opened] == [1.0, 1.5]
    for each in bench.opened:
        first = next(ns for ns, method, pulses in each.works.board.done if method == "pulses" and pulses[1] != 1530.0)
        assert (first - each.works.board.done[0][0]) / 1e9 >= each.settings.limits.arming_s


def test_a_motor_controller_that_never_arms_leaves_the_step_undone(tmp_path: Path, bench: Workbench) -> None:
    with pytest.raises(HardwareError, match="did not arm within 3 s, and nothing was written"):
        done(tmp_path, bench, "arming", *["", "n"] * 4)
    assert_untouched(tmp_path, bench)


def test_on_the_bench_no_pulse_leaves_the_reach_around_neutral(tmp_path: Path, bench: Workbench) -> None:
    done(tmp_path, bench, "ends", "2230", "1200", "", "1900", "", "", "")
    for steering, throttle in bench.pulses:
        assert steering == 0.0 or 830 <= steering <= 2230
        assert throttle == 0.0 or 1280 <= throttle <= 1780
