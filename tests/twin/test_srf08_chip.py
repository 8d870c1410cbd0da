"""The ultrasonic ranger: registers and times as its data sheet has them."""

from collections.abc import Sequence

import pytest
from twins import Clock

from tral_env.twin.srf08 import ANALOGUE_GAIN, Srf08Chip

LEFT = 0x70


def ranger(echoes: Sequence[float] | None = (1.0, 2.0)) -> tuple[Srf08Chip, Clock]:
    clock = Clock()
    return Srf08Chip(LEFT, lambda fired_s: echoes, clock), clock


def registers(chip: Srf08Chip, first: int, length: int) -> list[int]:
    chip.write(LEFT, [first])
    return list(chip.read(length))


def test_before_any_ranging_it_tells_its_version_and_no_echo() -> None:
    chip, _ = ranger()
    assert registers(chip, 0, 4) == [10, 128, 0, 0]


def test_a_ranging_takes_65_ms_in_which_the_bus_reads_0xff() -> None:
    chip, clock = ranger()
    chip.write(LEFT, [0, 0x51])
    clock.sleep(0.0649)
    assert registers(chip, 0, 2) == [0xFF, 0xFF]
    clock.sleep(0.0002)
    assert registers(chip, 0, 2) == [10, 128]


@pytest.mark.parametrize(("command", "unit_m"), [(0x50, 0.0254), (0x51, 0.01), (0x52, 1.716e-4)])
def test_the_command_sets_the_unit_of_all_echoes(command: int, unit_m: float) -> None:
    chip, clock = ranger()
    chip.write(LEFT, [0, command])
    clock.sleep(0.07)
    first, second = round(1.0 / unit_m), round(2.0 / unit_m)
    assert registers(chip, 2, 6) == [first >> 8, first & 0xFF, second >> 8, second & 0xFF, 0, 0]


def test_the_range_register_shortens_the_ranging_and_cuts_echoes_beyond_it() -> None:
    chip, clock = ranger()
    chip.write(LEFT, [2, 30])  # 31 * 43 mm = 1.33 m
    chip.write(LEFT, [0, 0x51])
    clock.sleep(0.065 * 31 / 256 + 0.0001)
    assert registers(chip, 2, 4) == [0, 100, 0, 0]


def test_a_smaller_gain_hears_less_far() -> None:
    chip, clock = ranger([1.0, 4.0])
    chip.write(LEFT, [1, 0])
    chip.write(LEFT, [0, 0x51])
    clock.sleep(0.07)
    assert 1.0 < 11.0 * (ANALOGUE_GAIN[0] / 1025) ** 0.5 < 4.0
    assert registers(chip, 2, 4) == [0, 100, 0, 0]


def test_it_takes_no_command_while_it_listens() -> None:
    chip, clock = ranger()
    chip.write(LEFT, [0, 0x51])
    chip.write(LEFT, [0, 0x52])
    clock.sleep(0.07)
    assert registers(chip, 2, 2) == [0, 100]


def test_it_stays_busy_until_the_world_has_come_to_the_ranging() -> None:
    chip, clock = ranger(None)
    chip.write(LEFT, [0, 0x51])
    clock.sleep(1.0)
    assert chip.busy


def test_it_listens_to_the_general_call_and_to_nobody_when_silent() -> None:
    chip, _ = ranger()
    assert [chip.answers_to(address) for address in (LEFT, 0x00, 0x71)] == [True, True, False]
    chip.silent = True
    assert not chip.answers_to(LEFT)


def test_a_frozen_one_ranges_and_keeps_its_echoes() -> None:
    ranges = [1.0]
    clock = Clock()
    chip = Srf08Chip(LEFT, lambda fired_s: list(ranges), clock)
    for frozen, expected in ((False, 100), (True, 100), (False, 200)):
        chip.frozen = frozen
        chip.write(LEFT, [0, 0x51])
        assert chip.busy
        clock.sleep(0.07)
        assert registers(chip, 2, 2) == [0, expected]
        ranges[0] = 2.0


def test_bytes_beyond_the_last_register_read_0xff() -> None:
    chip, _ = ranger()
    assert registers(chip, 35, 3) == [0, 0xFF, 0xFF]


def test_its_gain_is_31_at_most_and_other_commands_do_nothing() -> None:
    chip, clock = ranger([10.0])
    chip.write(LEFT, [1, 255])
    chip.write(LEFT, [0, 0xA0])
    chip.write(LEFT, [9, 1])
    assert not chip.busy
    chip.write(LEFT, [0, 0x51])
    clock.sleep(0.07)
    assert registers(chip, 2, 2) == [1000 >> 8, 1000 & 0xFF]
