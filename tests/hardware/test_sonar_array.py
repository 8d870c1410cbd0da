"""Three SRF08 on the bus: fired, left alone while they listen, read when ready."""

from itertools import pairwise

import numpy as np
import pytest
from fakes import Clock, FakeSmbus, Srf02Fake, Srf08Fake
from hypothesis import given
from hypothesis import strategies as st

from tral_env.config import UltrasonicConfig
from tral_env.errors import ConfigError, HardwareError
from tral_env.hardware.sonar import SonarArray, Srf02, Srf08
from tral_env.sensors.ultrasonic import measure

PERIOD_S = 0.0125


def rangers(clock, left=0.8, front=3.1, right=None, silent=False):
    return {
        0x70: Srf08Fake(clock, left, silent),
        0x71: Srf08Fake(clock, front, silent),
        0x72: Srf08Fake(clock, right, silent),
    }


def started(silent=False, **options):
    clock = Clock()
    devices = rangers(clock, silent=silent)
    bus = FakeSmbus(devices)
    array = SonarArray(bus, sleep=clock.sleep, **options)
    array.start()
    return array, clock, devices, bus


def ticks(array, clock, n):
    """Readings of n control periods."""
    readings = []
    for _ in range(n):
        readings.append(dict(array.read(clock())))
        clock.sleep(PERIOD_S)
    return readings


def test_before_the_first_answer_nothing_is_seen():
    array, clock, _, _ = started()
    assert ticks(array, clock, 2) == [{}, {}]


@pytest.mark.parametrize("silent", [False, True], ids=["busy reads 0xFF", "busy does not acknowledge"])
def test_ranges_come_back_with_their_age(silent):
    array, clock, _, _ = started(silent=silent)
    readings = ticks(array, clock, 6)
    # (116 + 1) * 43 mm there and back take 29.3 ms: the third tick after firing is the first that finds them ready.
    assert readings[2] == {}
    assert readings[3]["ultrasonic_left"] == pytest.approx(0.8, abs=1e-4)
    assert readings[3]["ultrasonic_front"] == pytest.approx(3.1, abs=1e-4)
    assert readings[3]["ultrasonic_right"] == 6.0
    ages = [reading["ultrasonic_left_age"] for reading in readings[3:]]
    assert ages == pytest.approx([3 * PERIOD_S, 4 * PERIOD_S, 5 * PERIOD_S])


def test_all_fire_together_at_the_cadence():
    array, clock, devices, _ = started()
    ticks(array, clock, 80)
    fired = [device.fired for device in devices.values()]
    assert fired[0] == fired[1] == fired[2]
    gaps = [later - earlier for earlier, later in pairwise(fired[0])]
    assert min(gaps) >= 0.065
    assert max(gaps) <= 0.065 + PERIOD_S


def test_in_turn_no_two_fire_at_once():
    array, clock, devices, _ = started(firing="in turn")
    readings = ticks(array, clock, 20)
    shots = sorted(time for device in devices.values() for time in device.fired)
    assert min(later - earlier for earlier, later in pairwise(shots)) >= 0.065
    assert readings[-1]["ultrasonic_front"] == pytest.approx(3.1, abs=1e-4)
    assert readings[-1]["ultrasonic_left_age"] > readings[-1]["ultrasonic_front_age"]


def test_registers_are_full_gain_and_five_metres():
    _, _, devices, _ = started()
    assert {(device.gain, device.range) for device in devices.values()} == {(31, 116)}


def test_microsecond_mode_is_one_broadcast_on_the_wire():
    array, clock, _, bus = started()
    bus.log.clear()
    array.read(clock())
    assert bus.log == [(0x00, 0, (0x52,))]


def test_centimetre_mode_has_its_command_its_scale_and_its_limit():
    array, clock, devices, _ = started(config=UltrasonicConfig(mode="cm"))
    reading = ticks(array, clock, 4)[-1]
    assert devices[0x70].command == 0x51
    assert reading["ultrasonic_left"] == pytest.approx(0.8)
    assert reading["ultrasonic_front"] == 6.0


def test_a_ranging_that_is_still_going_on_is_waited_for_at_the_start():
    clock = Clock()
    devices = rangers(clock)
    for device in devices.values():
        device.write(0, [0x52])
    array = SonarArray(FakeSmbus(devices), sleep=clock.sleep)
    array.start()
    assert {device.range for device in devices.values()} == {116}
    assert sum(clock.naps) < 0.1


def test_starting_again_forgets_all_ranges():
    array, clock, _, _ = started()
    ticks(array, clock, 6)
    array.start()
    assert array.read(clock()) == {}


@pytest.mark.parametrize("silent", [False, True], ids=["reads 0xFF", "does not acknowledge"])
def test_a_ranger_that_never_gets_ready_is_an_error(silent):
    array, clock, devices, _ = started(silent=silent)
    devices[0x71].stuck = True
    with pytest.raises(HardwareError, match="front ultrasonic"):
        ticks(array, clock, 40)
    assert clock() < 101


def test_one_firing_that_fails_is_nothing_new():
    array, clock, devices, bus = started()
    ticks(array, clock, 10)
    clock.sleep(0.065)
    before = len(devices[0x70].fired)
    array.read(clock())
    bus.failures = 1
    clock.sleep(0.065)
    array.read(clock())
    bus.failures = 1
    clock.sleep(PERIOD_S)
    array.read(clock())
    ticks(array, clock, 6)
    assert len(devices[0x70].fired) > before


def test_firing_that_fails_for_long_is_an_error():
    array, clock, _, bus = started()
    bus.failures = 10**6
    with pytest.raises(HardwareError, match="ultrasonics, all together"):
        ticks(array, clock, 40)
    assert 100.3 < clock() < 100.4


def test_a_ranger_that_is_not_there_is_named():
    clock = Clock()
    array = SonarArray(FakeSmbus({}), sleep=clock.sleep)
    with pytest.raises(HardwareError, match="left ultrasonic SRF08 at 0x70"):
        array.start()


@pytest.mark.parametrize("options", [{"firing": "at will"}, {"addresses": {"back": 0x70}}, {"addresses": {}}])
def test_unknown_firing_and_sides_are_refused(options):
    with pytest.raises(ConfigError, match="Allowed: together, in turn"):
        SonarArray(FakeSmbus({}), **options)


def test_a_range_that_no_srf08_has_is_refused_before_anything_is_sent():
    with pytest.raises(ConfigError, match=r"a range of 15 m: an SRF08 listens for 11\.008 m at most"):
        SonarArray(FakeSmbus({}), UltrasonicConfig(max_range=15.0))
    SonarArray(FakeSmbus({}), UltrasonicConfig(max_range=11.0))
    SonarArray(FakeSmbus({}), UltrasonicConfig(mode="cm", max_range=15.0))


class Register:
    """A ranger's device whose register of the first echo holds a number."""

    def __init__(self, units):
        self.units = units

    def read(self, register, length=1):
        assert (register, length) == (2, 2)
        return [self.units >> 8, self.units & 0xFF]


@given(st.integers(0, 0xFFFF), st.sampled_from(["us", "cm"]))
def test_a_register_is_read_as_the_simulated_ranger_reads_an_echo_there(units, mode):
    config = UltrasonicConfig(mode=mode)
    echo = np.array([units * (0.01 if mode == "cm" else config.metres_per_us)])
    neither_jitter_nor_outlier = np.array([[0.5, 1.0, 0.0, 0.0]])
    ranger = Srf08(Register(units), config)
    assert ranger.range_m(ranger.first_echo()) == measure(echo, neither_jitter_nor_outlier, config)[0]


def srf02(clock, **options):
    devices = {0x70: Srf02Fake(clock, 0.8), 0x71: Srf02Fake(clock, 3.1), 0x72: Srf02Fake(clock, None)}
    array = SonarArray(FakeSmbus(devices), sleep=clock.sleep, ranger=Srf02, **options)
    array.start()
    return array


@pytest.mark.parametrize("mode", ["us", "cm"])
def test_an_srf02_gets_its_command_at_its_own_address_and_nothing_else(mode):
    clock = Clock()
    array = srf02(clock, config=UltrasonicConfig(mode=mode))
    readings = ticks(array, clock, 12)
    reading = next(reading for reading in readings if "ultrasonic_left" in reading)
    assert reading["ultrasonic_left"] == pytest.approx(0.8, abs=1e-4)
    assert reading["ultrasonic_right"] == 6.0


def test_srf02_may_fire_in_turn():
    clock = Clock()
    array = srf02(clock, firing="in turn")
    readings = ticks(array, clock, 40)
    assert readings[-1]["ultrasonic_front"] == pytest.approx(3.1, abs=1e-4)


def test_an_srf02_that_does_not_answer_is_told_by_its_name():
    clock = Clock()
    array = SonarArray(FakeSmbus({}), sleep=clock.sleep, ranger=Srf02)
    with pytest.raises(HardwareError, match="left ultrasonic SRF02 at 0x70"):
        array.start()
    stuck = Srf02Fake(clock)
    stuck.stuck, stuck.silent = True, False
    stuck.answers_to = lambda own, address: address == own
    array = SonarArray(FakeSmbus({0x70: stuck}), addresses={"left": 0x70}, sleep=clock.sleep, ranger=Srf02)
    with pytest.raises(HardwareError, match="busy"):
        array.start()
