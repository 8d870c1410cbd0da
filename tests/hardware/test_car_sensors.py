"""The hall sensor's edges as distance and speed; several sensors as one."""

import numpy as np
import pytest
from fakes import Clock

from tral_env.config import HallConfig
from tral_env.hardware.sensors import HallCounter, SensorGroup
from tral_env.sensors.hall import Hall

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


def test_the_counter_agrees_with_the_simulated_sensor():
    clock = Clock()
    counter, simulated = HallCounter(clock=clock), Hall(1, HallConfig())
    rng = np.random.default_rng(7)
    for wait in rng.choice([0.01, 0.0123, 0.02, 0.05, 0.2, 0.3], 200):
        period = float(wait)
        clock.now = round(clock.now + period / 2, 4)
        counter.edge()
        # One tick of travel from the middle between two magnets passes a magnet in the middle of the period.
        end = clock.now + period / 2
        simulated.update(np.array([TICK_M]), end, period, np.full((1, 2), 0.5))
        clock.now = end
        reading = counter.read(end)
        assert reading["distance"] == pytest.approx(simulated.distance[0])
        assert reading["speed"] == pytest.approx(simulated.speed[0], rel=1e-2)


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
