"""Made-up readings for machines: one tick after the other."""

import json
from typing import Any

from tral_env.interface import CONTROL_PERIOD_S, CORE_LAYOUT
from tral_fsm.control.command import Command
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.estimator import Estimator
from tral_fsm.formats.tral_json import loads
from tral_fsm.runtime.driver import Driver
from tral_fsm.runtime.machine import Machine, Transit

SONARS = ("left", "front", "right")


class Feed:
    """Rows of observations: named readings stay until they are changed; a sonar that is set is new in that tick."""

    def __init__(self) -> None:
        self.values = {field.name: float(field.missing) for field in CORE_LAYOUT.fields}

    def row(self, **readings: float) -> list[float]:
        for name in ("gate_age", "marker_age", *(f"ultrasonic_{sonar}_age" for sonar in SONARS)):
            self.values[name] = min(self.values[name] + CONTROL_PERIOD_S, 10.0)
        for name, value in readings.items():
            if name in SONARS:
                self.values[f"ultrasonic_{name}"] = value
                self.values[f"ultrasonic_{name}_age"] = 0.0
            else:
                assert name in self.values, name
                self.values[name] = value
        return list(self.values.values())


class Bench:
    """A machine on a test bench: `tick(...)` gives readings and returns (steering, throttle)."""

    def __init__(self, definition: dict[str, Any]) -> None:
        self.fired: list[Transit] = []
        self.driver = Driver(loads(json.dumps(definition)), self.fired.append)
        self.feed = Feed()

    def tick(self, **readings: float) -> tuple[float, float]:
        return self.driver.act(self.feed.row(**readings))

    def see(self, **readings: float) -> tuple[float, float]:
        """Give the same readings in two ticks: what one image alone shows is not believed."""
        self.tick(**readings)
        return self.tick(**readings)

    def reset(self) -> None:
        """Begin another drive at another place."""
        self.driver.reset()
        self.feed = Feed()

    @property
    def machine(self) -> Machine:
        return self.driver.machine

    @property
    def estimator(self) -> Estimator:
        return self.driver.estimator

    @property
    def estimate(self) -> CarEstimate:
        """What the machine was given in the last tick."""
        return self.driver.estimate

    @property
    def command(self) -> Command:
        """What the machine answered in the last tick."""
        return self.driver.command

    @property
    def active(self) -> str:
        return self.driver.active_path


def one_state(**state: Any) -> Bench:
    """A machine of one state."""
    return Bench({"root": 0, "states": [{"id": 0, "final": True, **state}], "transitions": []})


def two_states(
    transition: dict[str, Any], first: dict[str, Any] | None = None, second: dict[str, Any] | None = None
) -> Bench:
    """A machine that goes from state "a" to state "b" by one transition."""
    a = first or {"type": "Motor", "throttle": 0.2}
    b = second or {"type": "Stop"}
    return Bench(
        {
            "root": "a",
            "states": [{"id": "a", **a}, {"id": "b", "final": True, **b}],
            "transitions": [{"id": "t", "from": "a", "to": "b", **transition}],
        }
    )
