"""Pulses reach the board, neutral comes first and last, whatever happens in between."""

import copy
import subprocess
import sys
from pathlib import Path

import pytest
from fakes import Clock, FakeSmbus, Pca9685Fake
from hypothesis import given
from hypothesis import strategies as st

from tral_env.errors import ConfigError, HardwareError, MissingExtraError
from tral_env.hardware.calibration_file import load_calibration
from tral_env.hardware.pwm import Pca9685, Recorder

TT01 = load_calibration("tt01")
STEP_US = 106 / 25e6 * 1e6
"""The divider nearest to 17.43 ms is 106: steps of 4.24 us."""
NEUTRAL = (361 * STEP_US, 361 * STEP_US)


def board(calibration=TT01, chip=None):
    """An open output on a fake chip."""
    chip = chip or Pca9685Fake(calibration.oscillator_hz)
    bus = FakeSmbus({0x40: chip})
    return Pca9685(calibration, bus, sleep=Clock().sleep), chip, bus


def test_the_first_pulses_that_leave_the_board_are_neutral():
    output, chip, _ = board()
    assert chip.seen[0] == NEUTRAL
    assert set(chip.seen) == {NEUTRAL}
    assert abs(NEUTRAL[0] - 1530) < STEP_US / 2
    output.close()


def test_the_board_runs_at_the_wanted_period_with_auto_increment():
    output, chip, _ = board()
    assert chip.registers[0xFE] == 105
    assert chip.registers[0x00] == 0x20
    assert chip.registers[0x01] == 0x04
    assert output.step_us == pytest.approx(STEP_US)
    assert output.period_us == pytest.approx(17367.04)
    output.close()


def test_a_board_left_running_by_a_crash_is_brought_to_neutral():
    first, chip, _ = board()
    first.write(1240, 1140)
    second, _, bus = board(chip=chip)
    assert chip.pulse_us(0) == chip.pulse_us(1) == NEUTRAL[0]
    assert bus.log[0] == (0x40, 0x00, (0x30,))
    first.close()
    second.close()


def test_the_board_gives_up_the_address_of_the_first_ultrasonic():
    chip = Pca9685Fake()
    assert chip.answers_to(0x40, 0x70)
    output, _, _ = board(chip=chip)
    assert not chip.answers_to(0x40, 0x70)
    output.close()


def test_both_pulses_change_in_one_transaction():
    output, chip, bus = board()
    before = len(bus.log)
    output.write(1240, 1860)
    assert len(bus.log) == before + 1
    assert chip.seen[-2:] == [NEUTRAL, (pytest.approx(293 * STEP_US), pytest.approx(438 * STEP_US))]
    output.close()


def test_channels_may_be_swapped():
    swapped = TT01.model_copy(update={"steering": TT01.steering.model_copy(update={"channel": 2})})
    output, chip, _ = board(swapped)
    output.write(1300, 1700)
    assert chip.pulse_us(2) == pytest.approx(1300, abs=STEP_US)
    assert chip.pulse_us(1) == pytest.approx(1700, abs=STEP_US)
    assert chip.pulse_us(0) == 0
    output.close()


@given(st.floats(1240, 1810), st.floats(1140, 1860), st.floats(24e6, 26e6))
def test_rounding_costs_less_than_a_step_and_never_a_hard_limit(steering, throttle, oscillator):
    car = TT01.model_copy(update={"oscillator_hz": oscillator})
    output, chip, _ = board(car)
    output.write(steering, throttle)
    sent = chip.pulse_us(0), chip.pulse_us(1)
    output.close()
    assert abs(sent[0] - steering) < output.step_us
    assert abs(sent[1] - throttle) < output.step_us
    assert sent[0] + 1e-9 >= 1240
    assert sent[0] - 1e-9 <= 1810
    assert sent[1] + 1e-9 >= 1140
    assert sent[1] - 1e-9 <= 1860


def test_a_measured_oscillator_gives_right_pulses():
    car = TT01.model_copy(update={"oscillator_hz": 26.4e6})
    output, chip, _ = board(car)
    output.write(1400, 1600)
    assert chip.pulse_us(0) == pytest.approx(1400, abs=output.step_us / 2)
    output.close()


def test_pulses_beyond_the_limits_are_cut():
    output, chip, _ = board()
    output.write(0, 9999)
    assert chip.pulse_us(0) >= 1240
    assert chip.pulse_us(1) <= 1860
    output.close()


@pytest.mark.parametrize("bad", [(float("nan"), 1530), (1530, float("inf"))])
def test_what_is_no_pulse_is_refused_before_anything_is_written(bad):
    output, _, bus = board()
    before = list(bus.log)
    with pytest.raises(ConfigError, match="refused"):
        output.write(*bad)
    assert bus.log == before
    output.close()


def test_closing_sends_neutral_and_leaves_the_board_sending():
    output, chip, bus = board()
    output.write(1240, 1140)
    output.close()
    output.close()
    assert chip.seen[-1] == NEUTRAL
    assert chip.awake
    assert not bus.closed, "a bus that was handed in belongs to its owner"
    with pytest.raises(HardwareError, match="closed"):
        output.write(1530, 1530)


def test_an_exception_inside_the_block_ends_in_neutral():
    output, chip, _ = board()
    output.write(1240, 1140)
    with pytest.raises(ZeroDivisionError), output:
        output.write(1240, 1140 / 0)
    assert chip.seen[-1] == NEUTRAL


CLOSE_FAILS = "bus.failures = 3; output.close()"


@pytest.mark.parametrize("ending", ["", "sys.exit(3)", "1 / 0", CLOSE_FAILS])
def test_the_end_of_the_interpreter_sends_neutral(ending):
    program = f"""
import atexit, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from fakes import FakeSmbus, Pca9685Fake
from tral_env.hardware.calibration_file import load_calibration
from tral_env.hardware.pwm import Pca9685
chip = Pca9685Fake()
atexit.register(lambda: print(round(chip.pulse_us(0)), round(chip.pulse_us(1))))
bus = FakeSmbus({{0x40: chip}})
output = Pca9685(load_calibration("tt01"), bus)
output.write(1240, 1140)
print(round(chip.pulse_us(0)), round(chip.pulse_us(1)))
{ending}
"""
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert run.stdout.splitlines() == ["1242 1141", "1531 1531"]


def test_a_silent_board_is_named_with_the_remedy():
    with pytest.raises(HardwareError, match=r"PCA9685 at 0x40 on FakeSmbus: no answer .*i2cdetect"):
        Pca9685(TT01, FakeSmbus({}))


def test_neutral_is_tried_again_when_the_bus_stutters():
    output, chip, bus = board()
    output.write(1240, 1140)
    bus.failures = 2
    output.close()
    assert chip.seen[-1] == NEUTRAL


def test_neutral_that_could_not_be_sent_is_an_error():
    output, _, bus = board()
    bus.failures = 99
    with pytest.raises(HardwareError) as caught:
        output.close()
    assert "cut the power" in caught.value.__notes__[0]
    bus.failures = 0
    output.close()


def test_neutral_that_failed_is_sent_by_the_next_close():
    output, chip, bus = board()
    output.write(1240, 1140)
    bus.failures = 3
    with pytest.raises(HardwareError):
        output.close()
    with pytest.raises(HardwareError, match="closed"):
        output.write(1240, 1140)
    assert chip.seen[-1] != NEUTRAL
    output.close()
    assert chip.seen[-1] == NEUTRAL


def test_another_chip_at_that_address_is_found_out():
    class Deaf(Pca9685Fake):
        def read(self, register, length):
            return [0x15] * length

    with pytest.raises(HardwareError, match="divider of 21 instead of 105"):
        board(chip=Deaf())


def test_a_bus_that_is_not_there_is_named_with_the_remedy(monkeypatch):
    smbus2 = pytest.importorskip("smbus2")

    def missing(bus):
        raise FileNotFoundError(2, "No such file or directory", f"/dev/i2c-{bus}")

    monkeypatch.setattr(smbus2, "SMBus", missing)
    with pytest.raises(HardwareError, match=r"cannot open the I2C bus /dev/i2c-7 .*output='recorder'"):
        Pca9685(TT01, 7)


def test_a_bus_that_was_opened_here_is_closed_here(monkeypatch):
    smbus2 = pytest.importorskip("smbus2")
    bus = FakeSmbus({0x40: Pca9685Fake()})
    monkeypatch.setattr(smbus2, "SMBus", lambda number: bus)
    Pca9685(TT01, 1).close()
    assert bus.closed


def test_without_smbus2_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "smbus2", None)
    with pytest.raises(MissingExtraError, match=r"pip install (-e )?'\.\[car\]"):
        Pca9685(TT01, 1)


def test_a_board_cannot_be_copied():
    output, _, _ = board()
    assert copy.deepcopy(output) is output
    output.close()


def test_the_recorder_keeps_times_and_pulses_with_neutral_first_and_last():
    clock = Clock()
    recorder = Recorder(TT01, clock)
    clock.sleep(0.5)
    recorder.write(1300, 9999)
    recorder.close()
    recorder.close()
    times = [sent.time_s for sent in recorder.sent]
    assert times == [100.0, 100.5, 100.5]
    assert [(s.steering_us, s.throttle_us) for s in recorder.sent] == [(1530, 1530), (1300, 1860), (1530, 1530)]
    with pytest.raises(HardwareError, match="closed"):
        recorder.write(1530, 1530)
