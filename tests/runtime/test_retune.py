"""Other numbers in the middle of a drive: they hold at once, and nothing starts again."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tral_env.errors import ConfigError, MachineError
from tral_env.interface import CORE_LAYOUT
from tral_fsm import FormatError, MachinePolicy, load_machine
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.runtime.driver import Driver
from tral_fsm.tuning.listing import listing
from tral_fsm.tuning.parameters import apply, find

MACHINES = ("office", "wall", "corridor", "gate_scurve", "known_route", "crossing", "lane_change")


def rows(seed: int, count: int = 80) -> list[np.ndarray]:
    """Readings of a car that drives somewhere."""
    rng = np.random.default_rng(seed)
    drawn = []
    for k in range(count):
        readings = {f"ultrasonic_{side}": rng.uniform(0.2, 3.0) for side in ("left", "front", "right")}
        ages = {f"{name}_age": 0.0125 * (k % 6) for name in readings}
        drawn.append(CORE_LAYOUT.pack({**readings, **ages, "distance": 0.012 * k, "speed": 0.9}, 1)[0])
    return drawn


def changed(machine: MachineDefinition, **values: float) -> MachineDefinition:
    """The machine with other values: path with __ for the dot -> value."""
    found = find(machine, [name.replace("__", ".") for name in values])
    return apply(machine, found, list(values.values()))


@pytest.mark.parametrize("name", MACHINES)
def test_the_same_numbers_change_nothing(name: str) -> None:
    machine = load_machine(name)
    one, other = MachinePolicy(machine), MachinePolicy(machine)
    for row in rows(1):
        other.retune(machine.model_copy())
        assert (one.act(row) == other.act(row)).all()


@pytest.mark.parametrize("name", MACHINES)
@settings(max_examples=10, deadline=None)
@given(st.data())
def test_before_the_first_tick_it_is_as_if_built_so(name: str, data: st.DataObject) -> None:
    machine = load_machine(name)
    numbers = [each.parameter for each in listing(machine) if each.parameter is not None]
    one = data.draw(st.sampled_from(numbers))
    value = data.draw(
        st.sampled_from(one.choices) if one.kind == "choice" else st.sampled_from([one.low, one.high, one.before])
    )
    try:
        other = apply(machine, [one], [round(float(value)) if one.kind == "int" else value])
    except ConfigError:
        return  # the machine does not allow the value
    retuned, built = MachinePolicy(machine), MachinePolicy(other)
    retuned.retune(other)
    for row in rows(2):
        assert (retuned.act(row) == built.act(row)).all()


def test_a_gain_holds_from_the_next_tick_on() -> None:
    machine = load_machine("wall")
    policy = MachinePolicy(machine)
    row = CORE_LAYOUT.pack({"ultrasonic_right": 0.7, "ultrasonic_right_age": 0.0}, 1)[0]
    before = float(policy.act(row)[0])
    patterns = [each.path for each in listing(machine) if each.path.endswith(".p")]
    policy.retune(apply(machine, found := find(machine, patterns), [0.0] * len(found)))
    assert before != 0.0
    assert abs(policy.act(row)[0]) < abs(before)


def test_the_active_state_and_what_it_remembers_stay() -> None:
    machine = load_machine("corridor")
    policy = MachinePolicy(machine)
    near = {"ultrasonic_front": 0.5, "ultrasonic_front_age": 0.0, "ultrasonic_right": 6.0, "distance": 3.0}
    policy.act(CORE_LAYOUT.pack(near, 1)[0])
    assert policy.active_states == ["turn right"]
    path = next(each.path for each in listing(machine) if each.path.startswith("state[turn right]"))
    policy.retune(apply(machine, find(machine, [path]), [0.5]))
    assert policy.active_states == ["turn right"]


def test_a_clearance_that_was_handed_over_is_no_number_of_the_file() -> None:
    from tral_fsm.states.wall import FollowWallRamp, FollowWallRampSpec

    estimate = MachinePolicy(load_machine("wall")).estimates[0]
    state = FollowWallRamp(FollowWallRampSpec(id="ramp", speed=0.5, start=0.8))
    state.on_enter(estimate)
    state.retune(FollowWallRampSpec(id="ramp", speed=0.5, start=0.8, target=0.3))
    assert (state.start, state.end_clearance) == (0.8, 0.3)
    state.set_target(estimate, (1.0, 0.2, 0.0))
    handed_over = state.end_clearance
    state.retune(FollowWallRampSpec(id="ramp", speed=0.5, start=0.8, target=0.9, p=2.0))
    assert (state.end_clearance, state.spec.p) == (handed_over, 2.0)


def test_a_machine_of_another_shape_is_refused() -> None:
    policy = MachinePolicy(load_machine("wall"))
    with pytest.raises(MachineError, match="start the new one"):
        policy.retune(load_machine("corridor"))


def test_a_machine_that_cannot_run_is_refused_and_the_old_one_goes_on() -> None:
    machine = load_machine("corridor")
    policy = MachinePolicy(machine)
    with pytest.raises(FormatError):
        policy.retune(machine.model_copy(update={"root": "nowhere"}))
    assert policy.definition is machine
    assert math.isfinite(policy.act(rows(3)[0])[0])


def test_a_car_that_the_watch_has_stopped_stays_stopped() -> None:
    machine = load_machine("wall")
    driver = Driver(machine)
    driver.watch.reason = "ultrasonic_right is silent"
    driver.retune(apply(machine, find(machine, ["state[0].side"]), ["left"]))
    assert driver.watch.reason == "ultrasonic_right is silent"
