"""The registers of the PWM board: neutral before it wakes, both pulses at once, off, and settings read back."""

from collections.abc import Sequence
from dataclasses import replace

import pytest
from fakes import FakeSmbus, Pca9685Fake
from rig import SETTINGS, STEERING, THROTTLE

from tral_env.errors import HardwareError
from tral_env.hardware.actuator.drivers import open_driver
from tral_env.hardware.actuator.laws import Channel
from tral_env.hardware.actuator.pca9685 import Board, all_off, still_on
from tral_env.hardware.i2c import Bus

STEP_US = 4.24


def board(
    chip: Pca9685Fake, steering: Channel = STEERING, throttle: Channel = THROTTLE, naps: list[float] | None = None
) -> tuple[Board, FakeSmbus]:
    bus = FakeSmbus({0x40: chip})
    device = Bus(bus).device(0x40, "PWM board PCA9685")
    sleep = ([] if naps is None else naps).append
    return Board(device, period_us=17430, oscillator_hz=25e6, steering=steering, throttle=throttle, sleep=sleep), bus


def test_a_board_wakes_with_neutral_and_its_settings_read_back_right() -> None:
    chip, naps = Pca9685Fake(), list[float]()
    chip.registers[0x01] = 0x10  # an open-drain board, changed on STOP or ACK
    opened, bus = board(chip, naps=naps)
    opened.start()
    assert chip.seen[0] == pytest.approx((1530, 1500), abs=STEP_US / 2)
    assert opened.check() == ""
    assert chip.registers[0x01] == 0x04
    assert bus.log[0] == (0x40, 0x00, (0x30,)), "asleep, and deaf to its second address"
    assert bus.log[-1] == (0x40, 0x00, (0x20,)), "no restart where none is due"
    assert 0.0005 <= sum(naps) < 0.005


def test_the_outputs_may_be_any_two_neighbours_in_either_order() -> None:
    chip = Pca9685Fake()
    opened, bus = board(chip, STEERING._replace(output=6), THROTTLE._replace(output=5))
    opened.start()
    opened.set_pulses(1700, 1300)
    assert bus.log[-1][1] == 0x06 + 4 * 5
    assert (chip.pulse_us(6), chip.pulse_us(5)) == pytest.approx((1700, 1300), abs=STEP_US / 2)
    assert not any(chip.pulse_us(other) for other in range(16) if other not in (5, 6))


def test_another_chip_is_found_out() -> None:
    class Other(Pca9685Fake):
        def read(self, register: int, length: int) -> list[int]:
            return [0] * length

    with pytest.raises(HardwareError, match="divider of 0 instead of 105"):
        board(Other())[0].start()


def test_a_board_that_was_left_driving_is_started_in_neutral() -> None:
    chip = Pca9685Fake()
    first, _ = board(chip)
    first.start()
    first.set_pulses(1240, 1100)
    second, _ = board(chip)
    second.start()
    assert chip.seen[-1] == pytest.approx((1530, 1500), abs=STEP_US / 2)
    assert second.check() == ""


def test_a_board_that_waits_for_a_restart_is_restarted() -> None:
    class Waiting(Pca9685Fake):
        """A chip that keeps its bit RESTART until 1 is written to it, as the data sheet describes."""

        waits = True

        def read(self, register: int, length: int) -> list[int]:
            found = super().read(register, length)
            return [found[0] | 0x80, *found[1:]] if register == 0 and self.waits else found

        def write(self, register: int, data: Sequence[int]) -> None:
            if register == 0 and data[0] & 0x80:
                self.waits = False
            super().write(register, data)

    opened, bus = board(Waiting())
    opened.start()
    assert bus.log[-1] == (0x40, 0x00, (0xA0,))
    assert opened.check() == ""


def test_off_ends_both_pulses_in_one_transaction_and_pulses_come_back() -> None:
    chip = Pca9685Fake()
    opened, bus = board(chip)
    opened.start()
    before = len(bus.log)
    opened.off()
    assert bus.log[before:] == [(0x40, 0x06, (0, 0, 0, 0x10, 0, 0, 0, 0x10))]
    assert chip.seen[-1] == (0.0, 0.0)
    opened.set_pulses(1600, 1400)
    assert chip.seen[-1] == pytest.approx((1600, 1400), abs=STEP_US / 2)


def test_a_board_whose_supply_broke_down_has_lost_its_settings() -> None:
    chip = Pca9685Fake()
    opened, bus = board(chip)
    opened.start()
    bus.devices[0x40] = fresh = Pca9685Fake()
    assert opened.check() == "MODE1 0x11, MODE2 0x04, divider 30 instead of 0x20, 0x04, 105"
    opened.set_pulses(1240, 1100)
    assert not fresh.seen, "a board that sleeps sends nothing"
    opened.start()
    assert opened.check() == ""
    assert set(fresh.seen) == {fresh.seen[0]}
    assert fresh.seen[0] == pytest.approx((1530, 1500), abs=STEP_US / 2)


def test_outputs_that_were_inverted_are_noticed() -> None:
    chip = Pca9685Fake()
    opened, _ = board(chip)
    opened.start()
    chip.registers[0x01] = 0x1F  # what the ultrasonics' gain of 31 is there
    assert opened.check() == "MODE1 0x20, MODE2 0x1f, divider 105 instead of 0x20, 0x04, 105"


def test_a_board_that_waits_for_another_clock_says_what_undoes_it() -> None:
    class Sticky(Pca9685Fake):
        def read(self, register: int, length: int) -> list[int]:
            return [value | (0x40 if register == 0 else 0) for value in super().read(register, length)]

    opened, bus = board(Sticky())
    with pytest.raises(HardwareError, match="EXTCLK, which only a power cycle undoes"):
        opened.start()
    assert bus.log == [(0x40, 0x00, (0x30,))], "it sleeps: no pulses"


def test_all_outputs_can_be_ended_without_knowing_the_car() -> None:
    chip = Pca9685Fake()
    opened, bus = board(chip)
    opened.start()
    all_off(Bus(bus).device(0x40, "board"))
    assert bus.log[-1] == (0x40, 0xFD, (0x10,)), "the chip's register ALL_LED_OFF_H, bit 4"
    assert chip.seen[-1] == (0.0, 0.0)
    assert still_on(Bus(bus).device(0x40, "board")) == []
    opened.set_pulses(1600, 1400)
    assert still_on(Bus(bus).device(0x40, "board")) == [0, 1]


def test_the_driver_opens_the_bus_and_the_board_of_its_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    smbus2 = pytest.importorskip("smbus2")
    chip = Pca9685Fake()
    bus = FakeSmbus({0x41: chip})
    opened: list[object] = []
    monkeypatch.setattr(smbus2, "SMBus", lambda number: (opened.append(number), bus)[1])
    driver = open_driver(replace(SETTINGS, driver="pca9685", bus=3, address=0x41))
    assert (opened, bus.log) == ([3], [])
    driver.start()
    driver.set_pulses(1600, 1400)
    assert chip.seen[-1] == pytest.approx((1600, 1400), abs=STEP_US / 2)
    assert driver.check() == ""
    driver.off()
    assert chip.seen[-1] == (0.0, 0.0)
