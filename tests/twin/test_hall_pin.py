"""The hall sensor's pin: edges as the kernel tells them."""

import struct
import time
from pathlib import Path

import pytest

from tral_env.errors import HardwareError
from tral_env.twin.car import bouncing
from tral_env.twin.hall import AWAY, NEAR, EdgeEvent, HallPin, LineRequest, TwinHallOptions


def test_an_event_is_the_kernels_structure() -> None:
    data = struct.pack("=QIIII24x", 5_000_000_000, 1, 17, 3, 2)
    assert len(data) == 48
    assert EdgeEvent.unpack(data) == EdgeEvent(5_000_000_000, NEAR, 17, 3, 2)


def test_a_reader_hears_when_a_magnet_came_near_and_left(tmp_path: Path) -> None:
    pin = HallPin(tmp_path / "hall")
    request = LineRequest(tmp_path / "hall")
    assert not request.wait_edge_events(0.0)
    wait_for_reader(pin, request)
    pin.send([1.0, 1.025])
    events = read(request, 4)
    stamps = [(event.timestamp_ns, event.event_type) for event in events]
    assert stamps == [
        (1_000_000_000, NEAR),
        (1_000_500_000, AWAY),
        (1_025_000_000, NEAR),
        (1_025_500_000, AWAY),
    ]
    numbers = [event.line_seqno for event in events]
    assert numbers == list(range(numbers[0], numbers[0] + 4))
    assert {event.line_offset for event in events} == {17}
    request.release()
    pin.close()


def wait_for_reader(pin: HallPin, request: LineRequest) -> None:
    """Tell edges until the pin has taken the reader in."""
    while not request.wait_edge_events(0.05):
        pin.send([0.0])
    request.read_edge_events()


def read(request: LineRequest, count: int) -> list[EdgeEvent]:
    events: list[EdgeEvent] = []
    while len(events) < count:
        assert request.wait_edge_events(5.0)
        events += request.read_edge_events(count - len(events))
    return events


def test_a_reader_may_have_its_own_names_for_the_kinds(tmp_path: Path) -> None:
    pin = HallPin(tmp_path / "hall")
    request = LineRequest(tmp_path / "hall", kinds=lambda number: {NEAR: "rising", AWAY: "falling"}[number])
    wait_for_reader(pin, request)
    pin.send([1.0])
    assert [event.event_type for event in read(request, 2)] == ["rising", "falling"]
    request.release()
    pin.send([2.0])  # nobody is there any more
    pin.close()


def test_a_reader_that_does_not_read_keeps_nobody(tmp_path: Path) -> None:
    pin = HallPin(tmp_path / "hall")
    request = LineRequest(tmp_path / "hall")
    wait_for_reader(pin, request)
    pin.send([k * 0.01 for k in range(5000)])
    other = LineRequest(tmp_path / "hall")
    wait_for_reader(pin, other)
    pin.send([60.0])
    assert [event.timestamp_ns for event in read(other, 2)] == [60_000_000_000, 60_000_500_000]
    request.release()
    other.release()
    pin.close()


def test_without_a_twin_there_is_no_pin(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match="is the twin up"):
        LineRequest(tmp_path / "hall")


def test_a_pin_that_ends_ends_its_readers(tmp_path: Path) -> None:
    pin = HallPin(tmp_path / "hall")
    request = LineRequest(tmp_path / "hall")
    wait_for_reader(pin, request)
    pin.close()
    with pytest.raises(OSError, match="gone"):
        request.read_edge_events(1000)
    request.release()


def test_the_counter_takes_the_time_of_each_edge(tmp_path: Path) -> None:
    pin = HallPin(tmp_path / "hall")
    hall = TwinHallOptions(path=str(tmp_path / "hall")).open(lambda: 0.0, lambda seconds: None)
    hall.start()
    while hall.read(0.0)["distance"] == 0.0:
        pin.send([0.0])
    pin.send([1.0, 1.025, 1.05, 1.075])
    # Edges at 0.0 s may still be on their way to the counter, so no number of edges tells when it has read these four.
    expected = pytest.approx(0.02513 / 0.025, rel=0.01)
    give_up = time.monotonic() + 10.0
    while hall.read(1.08)["speed"] != expected and time.monotonic() < give_up:
        time.sleep(0.001)
    assert hall.read(1.08)["speed"] == expected
    hall.stop()
    pin.close()


def test_a_bouncing_sensor_gives_three_edges_for_one() -> None:
    assert bouncing([1.0, 2.0]) == pytest.approx([1.0, 1.0004, 1.0011, 2.0, 2.0004, 2.0011])
