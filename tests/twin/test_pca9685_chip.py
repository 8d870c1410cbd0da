"""The PWM board: registers and pulses as NXP's data sheet, revision 4, has them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import Clock

from tral_env.twin.pca9685 import Pca9685Chip

OWN = 0x40
SLEEP, AI, RESTART, EXTCLK = 0x10, 0x20, 0x80, 0x40


def awake(oscillator_hz: float = 25e6, divider: int = 0x1E) -> tuple[Pca9685Chip, Clock]:
    clock = Clock()
    chip = Pca9685Chip(oscillator_hz, clock=clock)
    write(chip, 0xFE, divider)
    write(chip, 0x00, AI)
    clock.sleep(0.001)
    return chip, clock


def write(chip: Pca9685Chip, register: int, *data: int) -> None:
    assert chip.write(OWN, [register, *data])


def read(chip: Pca9685Chip, register: int, length: int = 1) -> list[int]:
    assert chip.write(OWN, [register])
    return list(chip.read(length))


def set_output(chip: Pca9685Chip, output: int, on: int, off: int) -> None:
    write(chip, 0x06 + 4 * output, on & 0xFF, on >> 8, off & 0xFF, off >> 8)


def test_registers_have_their_power_on_values() -> None:
    chip = Pca9685Chip()
    values = {0x00: 0x11, 0x01: 0x04, 0x02: 0xE2, 0x03: 0xE4, 0x04: 0xE8, 0x05: 0xE0, 0xFE: 0x1E}
    assert {register: read(chip, register)[0] for register in values} == values
    assert [read(chip, register)[0] for register in range(0x06, 0x46)] == [0, 0, 0, 0x10] * 16
    assert [chip.pulse_us(output) for output in range(16)] == [0.0] * 16


def test_a_period_has_4096_steps_of_the_divided_clock() -> None:
    chip, _ = awake(27e6, divider=106)
    assert chip.step_us == pytest.approx(107 / 27)
    assert chip.period_us == pytest.approx(4096 * 107 / 27)


@given(on=st.integers(0, 4095), off=st.integers(0, 4095), oscillator_hz=st.floats(24e6, 28.7e6))
def test_a_pulse_lasts_from_its_on_step_to_its_off_step(on: int, off: int, oscillator_hz: float) -> None:
    chip, _ = awake(oscillator_hz)
    set_output(chip, 3, on, off)
    assert chip.pulse_us(3) == pytest.approx((off - on) % 4096 * 31 / oscillator_hz * 1e6)


def test_full_on_and_full_off() -> None:
    chip, _ = awake()
    set_output(chip, 0, 0x1000, 100)
    assert chip.pulse_us(0) == pytest.approx(chip.period_us)
    set_output(chip, 0, 0x1000, 0x1000)
    assert chip.pulse_us(0) == 0.0  # off goes first


def test_inverted_outputs_are_high_for_the_rest_of_the_period() -> None:
    chip, _ = awake()
    set_output(chip, 0, 0, 1000)
    write(chip, 0x01, 0x14)
    assert chip.pulse_us(0) == pytest.approx(3096 * chip.step_us)


def test_the_divider_changes_in_sleep_alone_and_is_3_at_least() -> None:
    chip, _ = awake(divider=100)
    write(chip, 0xFE, 50)
    assert read(chip, 0xFE) == [100]
    write(chip, 0x00, SLEEP)
    write(chip, 0xFE, 1)
    assert read(chip, 0xFE) == [3]


def test_without_auto_increment_all_bytes_go_to_one_register() -> None:
    chip = Pca9685Chip()
    write(chip, 0x06, 1, 2, 3)
    assert read(chip, 0x06, 3) == [3, 3, 3]
    assert read(chip, 0x07) == [0]


def test_auto_increment_writes_and_reads_registers_in_a_row() -> None:
    chip, _ = awake()
    write(chip, 0x06, 1, 2, 3, 4, 5)
    assert read(chip, 0x06, 6) == [1, 2, 3, 4, 5, 0]


def test_bits_that_the_board_does_not_have_read_0() -> None:
    chip, _ = awake()
    write(chip, 0x06, 0xFF, 0xFF, 0xFF, 0xFF)
    write(chip, 0x01, 0xFF)
    write(chip, 0x05, 0xFF)
    write(chip, 0x80, 0xFF)  # reserved
    assert read(chip, 0x06, 4) == [0xFF, 0x1F, 0xFF, 0x1F]
    assert (read(chip, 0x01), read(chip, 0x05), read(chip, 0x80)) == ([0x1F], [0xFE], [0])


def test_all_led_sets_every_output_and_reads_0() -> None:
    chip, _ = awake()
    write(chip, 0xFA, 0, 0, 0x34, 0x02)
    assert {chip.pulse_us(output) for output in range(16)} == {0x234 * chip.step_us}
    assert read(chip, 0xFA, 4) == [0, 0, 0, 0]
    write(chip, 0xFD, 0x10)
    assert {chip.pulse_us(output) for output in range(16)} == {0.0}


def test_the_outputs_run_half_a_millisecond_after_the_wake_up() -> None:
    chip, clock = awake()
    set_output(chip, 0, 0, 400)
    write(chip, 0x00, AI | SLEEP)
    write(chip, 0x06, 0)  # no restart is due then
    write(chip, 0x00, AI)
    assert chip.pulse_us(0) == 0.0
    clock.sleep(0.0006)
    assert chip.pulse_us(0) > 0.0


def test_a_sleep_amid_pulses_wants_a_restart() -> None:
    chip, clock = awake()
    set_output(chip, 0, 0, 400)
    write(chip, 0x00, AI | SLEEP)
    assert read(chip, 0x00) == [RESTART | AI | SLEEP]
    write(chip, 0x00, AI)
    clock.sleep(0.001)
    assert read(chip, 0x00) == [RESTART | AI]
    assert chip.pulse_us(0) == 0.0
    write(chip, 0x00, AI | RESTART)
    assert read(chip, 0x00) == [AI]
    assert chip.pulse_us(0) == pytest.approx(400 * chip.step_us)


def test_a_sleep_of_outputs_that_are_off_wants_no_restart() -> None:
    chip, _ = awake()
    write(chip, 0x00, AI | SLEEP)
    assert read(chip, 0x00) == [AI | SLEEP]


def test_new_pulses_make_a_restart_unnecessary() -> None:
    chip, clock = awake()
    set_output(chip, 0, 0, 400)
    write(chip, 0x00, AI | SLEEP)
    write(chip, 0x00, AI)
    set_output(chip, 0, 0, 500)
    clock.sleep(0.001)
    assert chip.pulse_us(0) == pytest.approx(500 * chip.step_us)


def test_the_external_clock_stays_until_a_power_cycle() -> None:
    chip, _ = awake()
    write(chip, 0x00, EXTCLK)  # taken in sleep alone
    assert read(chip, 0x00) == [0]
    write(chip, 0x00, SLEEP)
    write(chip, 0x00, SLEEP | EXTCLK)
    write(chip, 0x00, AI)
    assert read(chip, 0x00) == [EXTCLK | AI]
    set_output(chip, 0, 0, 400)
    assert chip.pulse_us(0) == 0.0
    chip.power_cycle()
    assert read(chip, 0x00) == [0x11]


def test_it_answers_to_the_addresses_that_mode1_switches_on() -> None:
    chip = Pca9685Chip()
    assert [address for address in range(128) if chip.answers_to(address)] == [0x00, 0x40, 0x70]
    write(chip, 0x00, 0x0E)
    assert [address for address in range(128) if chip.answers_to(address)] == [0x00, 0x40, 0x71, 0x72, 0x74]


def test_the_general_call_resets_it_by_one_byte_alone() -> None:
    chip, _ = awake(divider=100)
    assert not chip.write(0x00, [0x00, 0x51])  # the broadcast of the ultrasonics
    assert read(chip, 0xFE) == [100]
    assert chip.write(0x00, [0x06])
    assert read(chip, 0xFE) == [0x1E]


@pytest.mark.parametrize("last", [0x45, 0xFE])
def test_the_pointer_rolls_over_behind_the_outputs_and_behind_the_prescaler(last: int) -> None:
    chip, _ = awake()
    assert read(chip, last, 2)[1] == read(chip, 0x00)[0] == AI
