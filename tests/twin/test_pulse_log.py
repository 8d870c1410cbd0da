"""Pulses over time, and lateness."""

from twins import Clock

from tral_env.twin.lateness import Lateness
from tral_env.twin.pulse_log import PulseLog


def test_pulses_are_told_with_the_time_for_which_they_stood() -> None:
    clock, standing = Clock(), [(1500.0, 1500.0)]
    log = PulseLog(lambda: standing[0], clock)
    clock.now += 1.0
    standing[0] = (1600.0, 1500.0)
    log.note()
    clock.now += 0.5
    log.note()  # nothing new
    clock.now += 0.5
    assert log.take() == [(1.0, (1500.0, 1500.0)), (1.0, (1600.0, 1500.0))]
    clock.now += 2.0
    assert log.take() == [(2.0, (1600.0, 1500.0))]
    assert log.now_us == (1600.0, 1500.0)


def test_what_nobody_noted_is_seen_at_the_next_look() -> None:
    clock, standing = Clock(), [(0.0, 0.0)]
    log = PulseLog(lambda: standing[0], clock)
    clock.now += 1.0
    standing[0] = (1500.0, 1500.0)
    assert log.take() == [(1.0, (0.0, 0.0)), (0.0, (1500.0, 1500.0))]


def test_lateness_is_told_by_percentiles() -> None:
    lateness = Lateness()
    assert lateness.record()["late_max_ms"] == 0.0
    for k in range(101):
        lateness.add(k * 1e-3)
    record = lateness.record()
    assert [round(record[f"late_{name}_ms"]) for name in ("p50", "p99", "max")] == [50, 99, 100]
    assert record["ticks"] == 101
