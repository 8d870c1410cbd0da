"""Adafruit's library as an oracle: what it writes, the board understands; what it reads, it wrote."""

from typing import Any

import pytest
from adafruit import BusIO

from tral_env.hardware.actuator.laws import Channel
from tral_env.hardware.actuator.pca9685 import Board
from tral_env.hardware.i2c import Bus
from tral_env.twin.bus import I2cBus, I2cMessage, TwinSmbus
from tral_env.twin.pca9685 import Pca9685Chip

adafruit_pca9685 = pytest.importorskip("adafruit_pca9685", exc_type=ImportError)
FREQUENCIES = (50.0, 57.4, 60.0, 100.0)


class Tick:
    """A clock that has always gone on for long enough."""

    now = 0.0

    def __call__(self) -> float:
        self.now += 0.001
        return self.now


def board_and_library(oscillator_hz: float) -> tuple[Pca9685Chip, I2cBus, Any]:
    chip = Pca9685Chip(oscillator_hz, clock=Tick())
    bus = I2cBus([chip])

    def write_then_read(address: int, data: bytes, length: int) -> bytes:
        read = I2cMessage(address, length=length, reads=True)
        return bus.transfer([I2cMessage(address, data), read] if data else [read])[0]

    busio = BusIO(lambda address, data: bus.transfer([I2cMessage(address, data)]), write_then_read)
    return chip, bus, adafruit_pca9685.PCA9685(busio, reference_clock_speed=int(oscillator_hz))


@pytest.mark.parametrize("hz", FREQUENCIES)
def test_the_library_sets_and_reads_the_frequency(hz: float) -> None:
    chip, _, library = board_and_library(27e6)
    library.frequency = hz
    assert library.frequency == pytest.approx(1e6 / chip.period_us)
    assert library.frequency == pytest.approx(hz, rel=0.013)


@pytest.mark.parametrize("hz", FREQUENCIES)
def test_every_step_of_the_library_is_a_pulse_of_as_many_steps(hz: float) -> None:
    chip, _, library = board_and_library(26e6)
    library.frequency = hz
    for steps in range(1, 4096):
        library.channels[5].duty_cycle = steps << 4
        assert library.channels[5].duty_cycle == steps << 4
        assert chip.pulse_us(5) == steps * chip.step_us
        assert chip.pulse_us(5) == pytest.approx(steps / 4096 / library.frequency * 1e6, abs=1e-6)
    library.channels[5].duty_cycle = 0xFFFF
    assert chip.pulse_us(5) == pytest.approx(1e6 / library.frequency)
    library.channels[5].duty_cycle = 0
    assert chip.pulse_us(5) == 0.0


@pytest.mark.parametrize("hz", FREQUENCIES)
def test_the_car_and_the_library_agree_on_the_divider_and_within_a_step_on_pulses(hz: float) -> None:
    chip, bus, library = board_and_library(26.3e6)
    library.frequency = hz
    divider = TwinSmbus(bus).read_byte_data(0x40, 0xFE)
    channels = [Channel(output, 600.0, 1500.0, 2400.0, 0.0, 600.0, 2400.0, 0.0) for output in (0, 1)]
    car = Board(
        Bus(TwinSmbus(bus)).device(0x40, "board"),
        period_us=1e6 / hz,
        oscillator_hz=26.3e6,
        steering=channels[0],
        throttle=channels[1],
        sleep=lambda seconds: None,
    )
    car.start()
    assert TwinSmbus(bus).read_byte_data(0x40, 0xFE) == divider
    for us in range(600, 2401, 3):
        car.set_pulses(us, us)
        ours = chip.pulse_us(0)
        library.channels[0].duty_cycle = round(us * library.frequency * 65536e-6)
        theirs = chip.pulse_us(0)
        assert abs(ours - us) <= chip.step_us / 2 + 1e-9 or us in (600, 2400)  # never beyond a limit
        assert 0 <= ours - theirs <= chip.step_us + 1e-9 or abs(ours - theirs) < 1e-9
