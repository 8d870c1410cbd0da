"""Machines in machines against the rules of docs/state_machine.md, written down once more in the plainest way."""

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tral_env.interface import CONTROL_PERIOD_S, CORE_LAYOUT
from tral_fsm import MachinePolicy
from tral_fsm.formats.tral_json import loads

Raw = dict[str, Any]


@dataclass
class Plain:
    """A machine of motors and machines, with transitions by time and front range."""

    raw: Raw
    here: int = -1
    entered: int = 0
    inner: "Plain | None" = None

    def enter(self, state: int, now: int) -> None:
        self.here, self.entered = state, now
        machine = self.raw["states"][state].get("machine")
        self.inner = Plain(machine) if machine else None
        if self.inner is not None:
            self.inner.enter(machine["root"], now)

    def tick(self, front: float, now: int) -> float:
        """Output first, that of the inner machine with its transition; then the first transition that holds."""
        if self.here < 0:
            self.enter(self.raw["root"], now)
        output: float = self.raw["states"][self.here].get("throttle", 0.0)
        if self.inner is not None:
            output = self.inner.tick(front, now)
        for way in self.raw["transitions"]:
            if way["from"] == self.here and self.holds(way, front, now):
                self.enter(way["to"], now)
                break
        return output

    def holds(self, way: Raw, front: float, now: int) -> bool:
        if way["type"] == "Timer":
            return bool(now - self.entered >= round(way["seconds"] * 80))
        return bool(front < way["below"])

    @property
    def path(self) -> str:
        return str(max(self.here, 0)) + (f"/{self.inner.path}" if self.inner is not None else "")


def machine(depth: int) -> st.SearchStrategy[Raw]:
    motor = st.builds(lambda t: {"type": "Motor", "throttle": t / 64}, st.integers(0, 63))
    state = motor if depth == 0 else motor | st.builds(lambda m: {"type": "FSMState", "machine": m}, machine(depth - 1))
    condition = st.builds(lambda k: {"type": "Timer", "seconds": CONTROL_PERIOD_S * k}, st.integers(1, 5)) | st.builds(
        lambda k: {"type": "SensorLevel", "sensor": "front", "below": 0.5 * k}, st.integers(1, 5)
    )
    ways = st.lists(st.tuples(st.integers(0, 2), st.integers(0, 2), condition), max_size=5)

    def put(states: list[Raw], drawn: list[tuple[int, int, Raw]]) -> Raw:
        ring = [(k, (k + 1) % 3, {"type": "Timer", "seconds": CONTROL_PERIOD_S * 7}) for k in range(3)]
        seen: list[Any] = []
        transitions = []
        for source, target, when in [*drawn, *ring]:
            if (source, when) not in seen:  # the same condition again is refused
                seen.append((source, when))
                transitions.append({"id": len(transitions), "from": source, "to": target, **when})
        return {"root": 0, "states": [{"id": k, **s} for k, s in enumerate(states)], "transitions": transitions}

    return st.builds(put, st.lists(state, min_size=3, max_size=3), ways)


@settings(max_examples=150, deadline=None)
@given(
    machine(2), st.lists(st.sampled_from([0.3, 0.8, 1.2, 1.8, 2.2, 6.0]), min_size=40, max_size=40), st.integers(1, 38)
)
def test_nested_machines_tick_as_the_page_says(raw: Raw, fronts: list[float], reset_at: int) -> None:
    policy = MachinePolicy(loads(json.dumps(raw)))
    policy.reset(2)
    plains = [Plain(raw), Plain(raw)]
    for k, front in enumerate(fronts):
        if k == reset_at:
            policy.reset_rows(np.array([True, False]))
            plains[0] = Plain(raw)
        row = CORE_LAYOUT.pack({"ultrasonic_front": front, "ultrasonic_front_age": 0.0}, 2)
        got = policy.act(row)[:, 1].tolist()
        assert got == [plain.tick(front, k) for plain in plains]
        assert policy.active_states == [plain.path for plain in plains]
