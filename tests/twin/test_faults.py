"""Each fault does to the twin what its words say."""

import errno
from itertools import pairwise
from typing import Any

import pytest
from twins import Clock, twin_by_hand

from tral_env.errors import ConfigError
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.twin.faults import INJECTED_FAULTS
from tral_env.twin.twin import Twin

MODE1, BOARD, LEFT = 0x00, 0x40, 0x70


def twin_awake(**settings: Any) -> tuple[Twin, Clock]:
    """A nominal car whose board sends neutral; its motor controller is armed."""
    twin, clock = twin_by_hand(scenario="straight", randomization="none", seed=3, oscillator_hz=25e6, **settings)
    twin.smbus.write_byte_data(BOARD, MODE1, 0x30)
    twin.smbus.write_byte_data(BOARD, 0xFE, 106)
    twin.smbus.write_byte_data(BOARD, MODE1, 0x20)
    send(twin, 1530.0, 1530.0)
    clock.sleep(1.0)
    return twin, clock


def send(twin: Twin, steering_us: float, throttle_us: float) -> None:
    ends = [round(us / twin.pca9685.step_us) for us in (steering_us, throttle_us)]
    twin.smbus.write_i2c_block_data(BOARD, 0x06, [byte for end in ends for byte in (0, 0, end & 0xFF, end >> 8)])


def errno_of(twin: Twin, address: int = BOARD) -> int | None:
    try:
        twin.smbus.read_byte_data(address, MODE1)
    except OSError as error:
        return error.errno
    return None


def fired(twin: Twin, clock: Clock) -> list[int]:
    twin.smbus.write_byte_data(LEFT, 0, 0x51)
    clock.sleep(0.08)
    return twin.smbus.read_i2c_block_data(LEFT, 2, 2)


def test_errors_on_the_bus() -> None:
    twin, _ = twin_awake()
    twin.faults.begin("i2c-errors", rate=1.0)
    assert errno_of(twin) == errno.EREMOTEIO
    twin.faults.end("i2c-errors")
    assert errno_of(twin) is None


def test_a_bus_that_times_out_blocks_for_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    twin, _ = twin_awake()
    monkeypatch.setattr("tral_env.twin.faults.BLOCKS_S", 0.01)
    twin.faults.begin("i2c-timeout")
    assert errno_of(twin) == errno.ETIMEDOUT
    twin.faults.end("i2c-timeout")
    assert errno_of(twin) is None


def test_a_stuck_bus_fails_at_once() -> None:
    twin, _ = twin_awake()
    twin.faults.begin("bus-stuck")
    assert errno_of(twin) == errno.EAGAIN


def test_a_brown_out_ends_the_pulses_and_forgets_the_settings() -> None:
    twin, _ = twin_awake()
    assert twin.status()["throttle_us"] > 1500.0
    twin.faults.begin("brown-out")
    assert twin.status()["throttle_us"] == 0.0
    assert twin.smbus.read_byte_data(BOARD, MODE1) == 0x11
    twin.faults.end("brown-out")


def test_silent_ultrasonics_do_not_answer() -> None:
    twin, _ = twin_awake()
    twin.faults.begin("sonar-silent")
    assert errno_of(twin, LEFT) == errno.EREMOTEIO
    twin.faults.end("sonar-silent")
    assert errno_of(twin, LEFT) is None


def test_frozen_ultrasonics_answer_the_same_while_the_car_moves() -> None:
    twin, clock = twin_awake()
    send(twin, 1240.0, 1140.0)
    before = fired(twin, clock)
    twin.faults.begin("sonar-frozen")
    clock.sleep(1.0)
    assert [fired(twin, clock), fired(twin, clock)] == [before] * 2
    twin.faults.end("sonar-frozen")
    assert fired(twin, clock) != before


def test_a_hall_sensor_that_is_off_and_one_that_bounces() -> None:
    twin, clock = twin_awake()
    send(twin, 1530.0, 1335.0)
    heard: list[float] = twin.heard  # type: ignore[attr-defined]
    clock.sleep(1.0)
    plain = len(heard)
    assert plain > 10
    twin.faults.begin("hall-off")
    clock.sleep(1.0)
    assert len(heard) == plain
    twin.faults.end("hall-off")
    twin.faults.begin("hall-bouncing")
    heard.clear()
    clock.sleep(0.5)
    assert len(heard) % 3 == 0
    assert min(b - a for a, b in pairwise(heard)) == pytest.approx(0.0004)


def test_a_sagging_battery_loses_half_a_volt_in_a_second() -> None:
    twin, clock = twin_awake()
    full_v = twin.car.battery_v
    twin.faults.begin("battery-sagging")
    clock.sleep(1.0)
    assert twin.car.battery_v == pytest.approx(full_v - 0.5, abs=0.02)
    clock.sleep(0.25)
    twin.faults.end("battery-sagging")
    low_v = twin.car.battery_v
    clock.sleep(0.25)
    assert twin.car.battery_v == low_v


def test_a_reversed_servo_turns_the_car_the_other_way() -> None:
    yaws = []
    for fault in (None, "servo-reversed"):
        twin, clock = twin_awake()
        before = twin.car.info["yaw"]
        if fault:
            twin.faults.begin(fault)
        send(twin, 1240.0, 1335.0)
        clock.sleep(1.0)
        yaws.append(twin.car.info["yaw"] - before)
    assert yaws[0] > 0.1
    assert yaws[1] < -0.1


def test_an_unarmed_controller_does_not_drive_until_it_may_arm_again() -> None:
    twin, clock = twin_awake()
    twin.faults.begin("esc-unarmed")
    send(twin, 1530.0, 1335.0)
    clock.sleep(1.0)
    assert twin.car.info["speed_mps"] == pytest.approx(0.0, abs=0.01)
    twin.faults.end("esc-unarmed")
    send(twin, 1530.0, 1530.0)
    clock.sleep(1.0)
    send(twin, 1530.0, 1335.0)
    clock.sleep(1.0)
    assert twin.car.info["speed_mps"] > 0.5


def test_camera_and_ports_are_told_their_faults() -> None:
    twin, _ = twin_awake()
    for name in ("camera-gone", "camera-frozen"):
        twin.faults.begin(name)
        assert getattr(twin, name.replace("-", "_"))
        twin.faults.end(name)
        assert not getattr(twin, name.replace("-", "_"))
    for name in ("serial-garbage", "serial-unplugged"):  # there are no ports here: see test_serial_port.py
        twin.faults.begin(name)
        twin.faults.end(name)


def test_there_is_no_disk_to_fill_without_device_files() -> None:
    twin, _ = twin_awake()
    with pytest.raises(ConfigError, match="needs device files"):
        twin.faults.begin("disk-full")
    twin.faults.end("disk-full")


def test_a_fault_begins_at_its_time_and_ends_by_itself() -> None:
    twin, clock = twin_awake()
    begun_s = clock.now
    twin.faults.at(begun_s + 0.4, "bus-stuck", seconds=0.25)
    states = []
    for _ in range(4):
        clock.sleep(0.25)
        states.append(errno_of(twin))
    assert states == [None, errno.EAGAIN, None, None]
    assert not twin.faults.active


def test_a_fault_that_is_to_come_does_not_come_once_it_was_ended() -> None:
    twin, clock = twin_awake()
    for name in ("bus-stuck", "hall-off"):
        twin.faults.at(clock.now + 0.4, name)
    twin.faults.end("bus-stuck")
    clock.sleep(0.5)
    assert list(twin.faults.active) == ["hall-off"]


def test_a_fault_that_ends_by_itself_comes_again_at_its_next_time() -> None:
    twin, clock = twin_awake()
    twin.faults.begin("hall-off", seconds=0.1)
    twin.faults.at(clock.now + 0.4, "hall-off")
    clock.sleep(0.2)
    assert not twin.faults.active
    clock.sleep(0.3)
    assert list(twin.faults.active) == ["hall-off"]


def test_a_serial_board_counts_what_its_hall_sensor_gives() -> None:
    twin, clock = twin_awake()
    send(twin, 1530.0, 1300.0)
    clock.sleep(1.0)
    ticks = [twin.car.board_readings.ticks]
    for fault in ("hall-off", "hall-bouncing"):
        twin.faults.begin(fault)
        clock.sleep(0.5)
        twin.faults.end(fault)
        ticks.append(twin.car.board_readings.ticks)
    assert ticks[0] > 0
    assert ticks[1] == ticks[0]
    assert (ticks[2] - ticks[1]) % 3 == 0
    assert ticks[2] - ticks[1] > 15


def test_unknown_faults_and_rates_are_refused() -> None:
    twin, _ = twin_awake()
    with pytest.raises(ConfigError, match="unknown fault 'sonar-silence': did you mean 'sonar-silent'"):
        twin.faults.begin("sonar-silence")
    with pytest.raises(ConfigError, match="unknown fault"):
        twin.faults.at(0.0, "x")
    with pytest.raises(ConfigError, match="rate = 2"):
        twin.faults.begin("i2c-errors", rate=2)


def test_each_fault_is_told_in_words() -> None:
    assert len(INJECTED_FAULTS) == 16
    assert all(fault.told and not fault.told.endswith(".") for fault in INJECTED_FAULTS.values())
    assert CONTROL_PERIOD_S == 0.0125


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"rate": 0.0}, "rate = 0.0: expected a share above 0"),
        ({"rate": float("nan")}, "rate = nan: expected a finite number"),
        ({"seconds": float("nan")}, "seconds = nan: expected a finite number of s"),
        ({"seconds": -1.0}, "seconds = -1.0: expected a time above 0"),
    ],
)
def test_a_fault_of_no_share_or_no_time_is_refused(options: dict[str, float], told: str) -> None:
    twin, _ = twin_awake()
    with pytest.raises(ConfigError, match=told):
        twin.faults.begin("i2c-errors", **options)
    with pytest.raises(ConfigError, match=told):
        twin.faults.at(1.0, "i2c-errors", **options)
