"""The hall sensor on a pin: the kernel's edges, and what bounces."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from fakes import Clock

from tral_env.errors import HardwareError, MissingExtraError
from tral_env.hardware.hall_line import HallLine, HallOptions

RISING, FALLING = object(), object()
MS = 1_000_000


class Kernel:
    """A chip with one pin, whose edges the kernel stamps and keeps."""

    def __init__(self) -> None:
        self.kept: list[SimpleNamespace] = []
        self.asked: dict[str, Any] = {}
        self.released = 0
        self.refuses: Exception | None = None

    def request_lines(self, chip: str, pins: dict[int, Any], **options: Any) -> Kernel:
        if self.refuses is not None:
            raise self.refuses
        self.asked = {"chip": chip, "pins": pins, **options}
        return self

    def wait_edge_events(self, timeout: float) -> bool:
        assert timeout == 0, "a reading never waits"
        return bool(self.kept)

    def read_edge_events(self) -> list[SimpleNamespace]:
        events, self.kept = self.kept, []
        return events

    def release(self) -> None:
        self.released += 1

    def edge(self, at_s: float, kind: object) -> None:
        self.kept.append(SimpleNamespace(timestamp_ns=round(at_s * 1e9), event_type=kind))

    def magnet(self, at_s: float, near_s: float = 0.004) -> None:
        self.edge(at_s, RISING)
        self.edge(at_s + near_s, FALLING)


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Kernel:
    made = Kernel()
    gpiod, line = ModuleType("gpiod"), ModuleType("gpiod.line")
    gpiod.request_lines = made.request_lines  # type: ignore[attr-defined]
    gpiod.LineSettings = SimpleNamespace  # type: ignore[attr-defined]
    gpiod.EdgeEvent = SimpleNamespace(Type=SimpleNamespace(RISING_EDGE=RISING, FALLING_EDGE=FALLING))  # type: ignore[attr-defined]
    line.Edge = SimpleNamespace(BOTH="both")  # type: ignore[attr-defined]
    line.Bias = SimpleNamespace(PULL_UP="up", PULL_DOWN="down", DISABLED="none")  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "gpiod", gpiod)
    monkeypatch.setitem(sys.modules, "gpiod.line", line)
    return made


def opened(clock: Clock, **options: Any) -> Any:
    hall = HallOptions(**options).open(clock, clock.sleep)
    hall.start()
    return hall


def test_the_kernel_is_asked_for_both_edges_of_the_pin(kernel: Kernel) -> None:
    opened(Clock(), line=27, chip="/dev/gpiochip4", pull="down", active="high")
    assert kernel.asked["chip"] == "/dev/gpiochip4"
    ((number, pin),) = kernel.asked["pins"].items()
    assert (number, pin.edge_detection, pin.bias, pin.active_low) == (27, "both", "down", False)


def test_magnets_are_counted_with_the_times_of_the_kernel(kernel: Kernel) -> None:
    clock = Clock()
    hall = opened(clock)
    for tick in range(10):  # 0.5 m/s, however late the pin is read
        kernel.magnet(clock() + tick * 0.05026)
    clock.now += 9 * 0.05026 + 0.004
    reading = hall.read(clock())
    assert reading["distance"] == pytest.approx(10 * 0.02513)
    assert reading["speed"] == pytest.approx(0.5, rel=1e-3)


def test_edges_that_bounce_count_once_near_both_ends_of_a_magnet(kernel: Kernel) -> None:
    clock = Clock()
    hall = opened(clock)
    for magnet_s in (0.01, 0.06):
        for bounce_s in (0.0, 0.0002, 0.0005):  # the magnet comes
            kernel.edge(clock() + magnet_s + bounce_s, RISING)
            kernel.edge(clock() + magnet_s + bounce_s + 0.0001, FALLING)
        kernel.edge(clock() + magnet_s + 0.0007, RISING)
        for bounce_s in (0.0, 0.0002):  # it goes
            kernel.edge(clock() + magnet_s + 0.02 + bounce_s, FALLING)
            kernel.edge(clock() + magnet_s + 0.02 + bounce_s + 0.0001, RISING)
        kernel.edge(clock() + magnet_s + 0.0204, FALLING)
    clock.now += 0.1
    assert hall.read(clock())["distance"] == pytest.approx(2 * 0.02513)


def test_a_pin_that_never_rests_counts_one_edge(kernel: Kernel) -> None:
    clock = Clock()
    hall = opened(clock)
    for number in range(4000):
        kernel.edge(clock() + number * 0.0005, RISING if number % 2 == 0 else FALLING)
    clock.now += 2.0
    assert hall.read(clock())["distance"] == pytest.approx(0.02513)


def test_a_start_forgets_what_was_counted_and_what_the_kernel_kept(kernel: Kernel) -> None:
    clock = Clock()
    hall = opened(clock, metres_per_tick=0.1)
    kernel.magnet(clock())
    hall.start()
    clock.now += 1.0
    assert hall.read(clock()) == {"distance": 0.0, "speed": 0.0}
    kernel.magnet(clock())
    assert hall.read(clock())["distance"] == pytest.approx(0.1)


def test_the_pin_is_given_back_once(kernel: Kernel) -> None:
    hall = opened(Clock())
    hall.stop()
    hall.stop()
    assert kernel.released == 1


def test_a_pin_that_another_program_has_is_told_with_what_to_do(kernel: Kernel) -> None:
    kernel.refuses = OSError(16, "Device or resource busy")
    with pytest.raises(HardwareError, match=r"cannot use line 17 of /dev/gpiochip0 .*gpioinfo.*group gpio"):
        HallLine(HallOptions())


def test_gpiod_that_is_missing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gpiod", None)
    with pytest.raises(MissingExtraError, match="gpiod"):
        HallLine(HallOptions())


def test_the_library_has_all_that_is_used_of_it() -> None:
    gpiod = pytest.importorskip("gpiod")
    from gpiod.line import Bias, Edge

    assert {Bias.PULL_UP, Bias.PULL_DOWN, Bias.DISABLED, Edge.BOTH}
    assert gpiod.EdgeEvent.Type.RISING_EDGE is not None
    gpiod.LineSettings(edge_detection=Edge.BOTH, bias=Bias.PULL_UP, active_low=True)
    for method in ("wait_edge_events", "read_edge_events", "release"):
        assert hasattr(gpiod.LineRequest, method)
    with pytest.raises(HardwareError, match="cannot use line 17 of /dev/null"):
        HallLine(HallOptions(chip="/dev/null"))


def test_each_change_of_the_pin_can_be_watched_with_the_stamp_of_the_kernel(kernel: Kernel) -> None:
    clock, seen = Clock(), []
    hall = opened(clock)
    hall.watch_frames(lambda source, data: seen.append((source, data[0], int.from_bytes(data[1:], "little"))))
    kernel.magnet(2.0, near_s=0.004)
    hall.read(clock())
    assert seen == [("hall", 1, 2_000_000_000), ("hall", 0, 2_004_000_000)]
