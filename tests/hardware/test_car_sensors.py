"""The hall sensor's edges as distance and speed; several sensors as one."""

import numpy as np
import pytest
from fakes import Clock
from hypothesis import given
from hypothesis import strategies as st

from tral_env.config import HallConfig
from tral_env.hardware.sensors import HallCounter, SensorGroup
from tral_env.sensors.hall import EdgeSpeed, Hall

TICK_M = 0.02513


def test_at_rest_there_is_neither_distance_nor_speed():
    assert HallCounter().read(0.0) == {"distance": 0.0, "speed": 0.0}


def test_even_edges_give_distance_and_speed():
    clock = Clock()
    hall = HallCounter(clock=clock)
    for _ in range(10):
        hall.edge()
        clock.sleep(0.025)
    reading = hall.read(clock())
    assert reading["distance"] == pytest.approx(10 * TICK_M)
    assert reading["speed"] == pytest.approx(TICK_M / 0.025)


def test_a_start_counts_from_zero():
    hall = HallCounter()
    hall.edge()
    hall.start()
    assert hall.read(0.0) == {"distance": 0.0, "speed": 0.0}


def test_an_edge_that_comes_again_after_a_millisecond_does_not_show_in_the_speed():
    clock = Clock()
    hall = HallCounter(clock=clock)
    for _ in range(20):
        hall.edge()
        clock.sleep(0.001)
        hall.edge()
        clock.sleep(TICK_M / 2.0 - 0.001)
        assert hall.read(clock())["speed"] <= 2.02
    assert hall.read(clock())["speed"] == pytest.approx(2.0, rel=0.01)


@given(st.lists(st.tuples(st.floats(0.004, 0.4), st.booleans()), max_size=60), st.floats(0.0, 1e5))
def test_the_counter_tells_what_the_simulated_sensor_tells_bounces_included(passages, start):
    config, clock = HallConfig(), Clock()
    counter, simulated = HallCounter(config, clock), Hall(1, config)
    end = start
    for period, doubled in passages:
        # One tick of travel from the middle between two magnets passes a magnet in the middle of the period.
        end += period
        clock.now = when = end - period + 0.5 * period
        counter.edge()
        if doubled:
            clock.now = when + config.bounce_s
            counter.edge()
        simulated.update(np.array([TICK_M]), end, period, np.full((1, 2), 0.5), 0.0, float(doubled))
        assert counter.read(end) == {"distance": simulated.distance[0], "speed": simulated.speed[0]}


@given(st.lists(st.lists(st.integers(1, 4000), min_size=40, max_size=40), min_size=2, max_size=4))
def test_a_batch_of_wheels_tells_what_a_counter_for_each_tells(rows):
    config = HallConfig()
    stamps = np.cumsum(rows, axis=1) * config.stamp_s
    together, clocks = EdgeSpeed(len(rows), config), [Clock() for _ in rows]
    counters = [HallCounter(config, clock) for clock in clocks]
    for when in stamps.T:
        together.edge(np.full(len(rows), True), when)
        read_at = when + 0.003
        for i, counter in enumerate(counters):
            clocks[i].now = when[i]
            counter.edge()
            told = {"distance": together.distance[i], "speed": together.speed(read_at)[i]}
            assert counter.read(read_at[i]) == told


class Noted:
    """Sensors that write down what happens to them."""

    def __init__(self, name, log, fails=False):
        self.name, self.log, self.fails = name, log, fails

    def start(self):
        self.log.append(f"start {self.name}")

    def read(self, now):
        return {self.name: now}

    def stop(self):
        self.log.append(f"stop {self.name}")
        if self.fails:
            raise OSError(self.name)


def test_a_group_is_all_of_its_members():
    log = []
    group = SensorGroup(Noted("a", log), Noted("b", log))
    group.start()
    assert group.read(3.0) == {"a": 3.0, "b": 3.0}
    group.stop()
    assert log == ["start a", "start b", "stop a", "stop b"]


def test_a_member_that_fails_to_stop_does_not_keep_the_others():
    log = []
    with pytest.raises(OSError, match="a"):
        SensorGroup(Noted("a", log, fails=True), Noted("b", log)).stop()
    assert log == ["stop a", "stop b"]
