"""The sensors of the serial boards: from what they say to the readings of a policy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from random import Random
from typing import Any

import pytest
from fakes import Clock
from test_serial_frames import FRAME, streams, wire

from tral_env.errors import HardwareError
from tral_env.hardware.serial_sensors import Board2016SensorOptions, UcboardSensorOptions
from tral_env.interface import CORE_FIELDS, OPTIONAL_GROUPS

BOUNDS = {field.name: field for field in (*CORE_FIELDS, *OPTIONAL_GROUPS["line"], *OPTIONAL_GROUPS["battery"])}
PORT = "/dev/ttyUSB0"


class Port:
    """A serial port from which bytes come that a test put there."""

    def __init__(self) -> None:
        self.waiting = b""
        self.lost = self.closed = False

    def read(self, size: int) -> bytes:
        if self.lost:
            raise OSError("device disconnected")
        data, self.waiting = self.waiting[:size], self.waiting[size:]
        return data

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Port:
    made = Port()
    monkeypatch.setattr("tral_env.hardware.serial_sensors.open_port", lambda name, baud: made)
    return made


@pytest.fixture
def clock() -> Clock:
    return Clock()


def opened(kind: Any, clock: Clock, **options: Any) -> Any:
    sensors = kind(port=PORT, **options).open(clock, clock.sleep)
    sensors.start()
    return sensors


def test_a_frame_of_2016_becomes_readings(port: Port, clock: Clock) -> None:
    sensors = opened(Board2016SensorOptions, clock)
    port.waiting = wire() * 2
    clock.sleep(0.0125)
    assert sensors.read(clock()) == {
        "ultrasonic_front": pytest.approx(3.1),
        "ultrasonic_right": pytest.approx(0.8),
        "ultrasonic_left": pytest.approx(0.45),
        "ultrasonic_front_age": 0.0,
        "ultrasonic_right_age": 0.0,
        "ultrasonic_left_age": 0.0,
        "distance": 0.0,
        "speed": 0.0,
        "line": 0x18,
        "battery": pytest.approx(7.2),
    }
    assert sensors.provided_readings == set(sensors.read(clock()))


def test_a_range_of_0_keeps_the_old_value_and_its_age_grows(port: Port, clock: Clock) -> None:
    sensors = opened(Board2016SensorOptions, clock)
    port.waiting = wire() * 2
    sensors.read(clock())
    clock.sleep(0.1)
    port.waiting = wire(FRAME._replace(front=0, right=90)) + b"\x00\x0f"
    reading = sensors.read(clock())
    assert (reading["ultrasonic_front"], reading["ultrasonic_right"]) == (pytest.approx(3.1), pytest.approx(0.9))
    assert (reading["ultrasonic_front_age"], reading["ultrasonic_right_age"]) == (pytest.approx(0.1), 0.0)


def test_ranges_of_0_for_more_than_three_rangings_mean_that_no_echo_comes(port: Port, clock: Clock) -> None:
    sensors = opened(Board2016SensorOptions, clock)
    ranges = []
    for _ in range(15):
        port.waiting += wire(FRAME._replace(front=0))
        reading = sensors.read(clock())
        ranges.append((reading.get("ultrasonic_front"), reading.get("ultrasonic_front_age")))
        clock.sleep(0.02)
    assert ranges[:10] == [(None, None)] * 10
    assert ranges[-1] == (6.0, 0.0)


def driven(sensors: Any, port: Port, clock: Clock, counts: Iterator[int]) -> Mapping[str, float]:
    """Frames with counts of the hall sensor, 50 a second; the last reading."""
    for count in counts:
        clock.sleep(0.02)
        port.waiting += wire(FRAME._replace(hall=count % 65536))
        reading: Mapping[str, float] = sensors.read(clock())
    return reading


def test_1500_units_are_1_60_m_also_where_the_count_goes_round(port: Port, clock: Clock) -> None:
    sensors = opened(Board2016SensorOptions, clock)
    reading = driven(sensors, port, clock, iter(range(65000, 65000 + 1501, 15)))
    assert reading["distance"] == pytest.approx(1.6)
    assert reading["speed"] == pytest.approx(0.8)


def test_the_speed_falls_to_0_when_the_count_stands(port: Port, clock: Clock) -> None:
    sensors = opened(Board2016SensorOptions, clock)
    driven(sensors, port, clock, iter(range(0, 300, 15)))
    assert driven(sensors, port, clock, iter([285] * 20))["speed"] == 0.0


def test_a_board_that_began_anew_does_not_add_its_count(port: Port, clock: Clock) -> None:
    sensors = opened(Board2016SensorOptions, clock)
    driven(sensors, port, clock, iter(range(30000, 30150, 15)))
    assert driven(sensors, port, clock, iter([0, 15]))["distance"] == pytest.approx((135 + 15) / 937.5)


def test_groups_of_the_ucboard_become_readings(port: Port, clock: Clock) -> None:
    sensors = opened(UcboardSensorOptions, clock)
    port.waiting = b"##1:7306 | 18870 | 65000\x03##2:17 | 250\x03##3:7200\x03"
    reading = sensors.read(clock())
    assert reading["ultrasonic_left"] == pytest.approx(0.7306)
    assert reading["ultrasonic_front"] == pytest.approx(1.887)
    assert reading["ultrasonic_right"] == 6.0
    assert (reading["distance"], reading["speed"], reading["battery"]) == (0.0, 0.0, pytest.approx(7.2))
    assert sensors.provided_readings == set(reading)


def test_a_ucboard_without_values_leaves_the_old_ones(port: Port, clock: Clock) -> None:
    sensors = opened(UcboardSensorOptions, clock)
    port.waiting = b"##1:7306 | 18870 | 9000\x03##2:[---] | [---]\x03##3:65000\x03##1:[fault] | 18870 | 9000\x03"
    reading = sensors.read(clock())
    assert reading["ultrasonic_left"] == pytest.approx(0.7306)
    assert "battery" not in reading


def test_a_range_without_an_echo_is_new_and_a_spacing_beyond_the_clock_is_a_long_rest(port: Port, clock: Clock) -> None:
    sensors = opened(UcboardSensorOptions, clock)
    port.waiting = b"##1:[over] | 18870 | [range]\x03##2:17 | [over]\x03##2:[over] | 5\x03##2:18 | [over]\x03"
    reading = sensors.read(clock())
    assert (reading["ultrasonic_left"], reading["ultrasonic_left_age"]) == (6.0, 0.0)
    assert reading["distance"] == pytest.approx(0.02513)


def test_the_spacing_that_the_board_measured_gives_the_speed(port: Port, clock: Clock) -> None:
    sensors = opened(UcboardSensorOptions, clock)
    for tick in range(80):  # 1.005 m/s: an edge each 25 ms, read at the control rate
        clock.sleep(0.0125)
        if tick % 2:
            port.waiting = f"##2:{(250 + tick // 2) % 256} | 250\x03".encode()
        reading = sensors.read(clock())
    assert reading["distance"] == pytest.approx(39 * 0.02513)
    assert reading["speed"] == pytest.approx(0.02513 / 0.025, rel=1e-3)


def test_counts_that_were_lost_on_the_way_are_made_up_and_impossible_ones_are_not(port: Port, clock: Clock) -> None:
    sensors = opened(UcboardSensorOptions, clock)
    for count in (0, 4, 3):  # 4 edges in 50 ms are possible, 255 are not
        clock.sleep(0.05)
        port.waiting = f"##2:{count} | [---]\x03".encode()
        reading = sensors.read(clock())
    assert reading["distance"] == pytest.approx(4 * 0.02513)


@pytest.mark.parametrize("kind", [Board2016SensorOptions, UcboardSensorOptions])
def test_a_board_that_is_silent_or_talks_nonsense_is_told_after_half_a_second(
    port: Port, clock: Clock, kind: Any
) -> None:
    sensors = opened(kind, clock)
    for _ in range(39):
        clock.sleep(0.0125)
        port.waiting += b"\xff\xfe"
        sensors.read(clock())
    clock.sleep(0.02)
    with pytest.raises(HardwareError, match=r"has sent nothing that makes sense for 0\.5 s: check its power, and port"):
        sensors.read(clock())
    sensors.start()
    sensors.read(clock())


@pytest.mark.parametrize("kind", [Board2016SensorOptions, UcboardSensorOptions])
def test_a_plug_that_was_pulled_is_told_at_once(port: Port, clock: Clock, kind: Any) -> None:
    sensors = opened(kind, clock)
    port.lost = True
    with pytest.raises(HardwareError, match="the serial board at /dev/ttyUSB0 is lost"):
        sensors.read(clock())
    sensors.stop()
    sensors.stop()
    assert port.closed


@pytest.mark.parametrize("kind", [Board2016SensorOptions, UcboardSensorOptions])
def test_20000_random_streams_give_no_reading_out_of_bounds(port: Port, clock: Clock, kind: Any) -> None:
    sensors, random = opened(kind, clock), Random(20)
    for stream in streams(20_000):
        clock.now += random.choice((0.0125, 0.0, 1e-4))
        port.waiting += stream
        try:
            readings = sensors.read(clock())
        except HardwareError:
            sensors.start()
            continue
        for name, value in readings.items():
            assert BOUNDS[name].low <= value <= BOUNDS[name].high, (name, value)


@pytest.mark.parametrize("kind", [Board2016SensorOptions, UcboardSensorOptions])
def test_all_bytes_of_a_board_can_be_watched_as_they_come(port: Port, clock: Clock, kind: Any) -> None:
    sensors, seen = opened(kind, clock), []
    sensors.watch_frames(lambda source, data: seen.append((source, data)))
    for data in (b"garbled", b"", wire()):
        port.waiting = data
        sensors.read(clock())
    assert seen == [(PORT, b"garbled"), (PORT, wire())]
