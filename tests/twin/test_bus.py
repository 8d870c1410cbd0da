"""The I2C bus: who answers, what two answers make, and the faults of buses."""

import errno

import pytest
from twins import Clock

from tral_env.hardware.i2c import Bus
from tral_env.twin.bus import I2cBus, I2cMessage, TwinSmbus
from tral_env.twin.faults import BusTimeouts, RandomBusErrors, stuck
from tral_env.twin.pca9685 import Pca9685Chip
from tral_env.twin.srf08 import Srf08Chip


def bus_with_chips() -> I2cBus:
    rangers = [Srf08Chip(address, lambda fired_s: [1.0], Clock()) for address in (0x70, 0x71)]
    return I2cBus([Pca9685Chip(clock=Clock()), *rangers])


def errno_of(bus: I2cBus, address: int = 0x40) -> int | None:
    try:
        bus.transfer([I2cMessage(address, b"\0")])
    except OSError as error:
        return error.errno
    return None


def test_an_address_without_a_device_is_no_answer() -> None:
    bus = bus_with_chips()
    assert errno_of(bus, 0x41) == errno.EREMOTEIO
    with pytest.raises(OSError, match="Remote I/O"):
        bus.transfer([I2cMessage(0x00, length=1, reads=True)])  # nobody may answer a general call


def test_two_that_answer_at_once_garble_each_other() -> None:
    bus = TwinSmbus(bus_with_chips())
    board, both = 0x11, 0x11 & 10
    assert bus.read_byte_data(0x40, 0x00) == board
    assert bus.read_byte_data(0x70, 0x00) == both  # the board answers there until it is set up
    bus.write_byte_data(0x40, 0x00, 0x20)
    assert bus.read_byte_data(0x70, 0x00) == 10


def test_the_drivers_of_the_car_speak_to_it() -> None:
    device = Bus(TwinSmbus(bus_with_chips())).device(0x40, "board")
    device.write(0x00, 0x30)
    device.write(0x06, 1, 2)
    assert device.read(0x06, 2) == [1, 2]


def test_single_bytes_move_the_pointer_and_follow_it() -> None:
    bus = TwinSmbus(bus_with_chips())
    bus.write_byte(0x40, 0xFE)
    assert bus.read_byte(0x40) == 0x1E
    bus.close()


def test_without_supply_nobody_answers() -> None:
    bus = bus_with_chips()
    bus.powered = False
    assert errno_of(bus) == errno.EREMOTEIO


def test_each_transaction_that_succeeds_is_told() -> None:
    bus, told = bus_with_chips(), []
    bus.after = lambda: told.append(1)
    assert [errno_of(bus), errno_of(bus, 0x41)] == [None, errno.EREMOTEIO]
    assert len(told) == 1


def test_errors_come_at_their_rate() -> None:
    bus = bus_with_chips()
    bus.faults["errors"] = RandomBusErrors(0.1)
    failed = sum(errno_of(bus) == errno.EREMOTEIO for _ in range(2000))
    assert 150 < failed < 250


def test_a_timeout_blocks_for_a_second_and_a_stuck_bus_not_at_all() -> None:
    bus, clock = bus_with_chips(), Clock()
    bus.faults["timeout"] = BusTimeouts(clock.sleep)
    assert errno_of(bus) == errno.ETIMEDOUT
    assert clock.now == 101.0
    bus.faults = {"stuck": stuck}
    assert errno_of(bus) == errno.EAGAIN
