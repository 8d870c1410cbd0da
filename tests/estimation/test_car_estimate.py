"""The estimate of a tick: nothing can change it, and no state or condition can reach behind it."""

import importlib
import pickle
import pkgutil
from types import ModuleType

import numpy as np
import pytest
import toy

from tral_fsm import conditions, load_machine, states
from tral_fsm.control.command import IDLE
from tral_fsm.control.speed import SpeedController
from tral_fsm.estimation import estimator
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.estimator import Estimator
from tral_fsm.runtime.machine import Machine

ROOMS = [
    importlib.import_module(f"{room.__name__}.{found.name}")
    for room in (states, conditions)
    for found in pkgutil.iter_modules(room.__path__)
]


@pytest.mark.parametrize("name", CarEstimate._fields)
def test_no_field_can_be_set(name: str) -> None:
    estimate = CarEstimate()
    with pytest.raises(AttributeError):
        setattr(estimate, name, 1.0)


def test_no_attribute_can_be_added() -> None:
    with pytest.raises(AttributeError):
        CarEstimate().trim = 0.1  # type: ignore[attr-defined]


def test_what_it_holds_cannot_be_changed_either() -> None:
    """Only what is unchangeable through and through has a hash."""
    assert isinstance(hash(Estimator().update([0.0] * 20)), int)


@pytest.mark.parametrize("module", ROOMS, ids=lambda module: module.__name__)
def test_states_and_conditions_know_nothing_of_estimation_but_what_is_immutable(module: ModuleType) -> None:
    known = [thing for thing in vars(module).values() if isinstance(thing, type)]
    assert [
        kind for kind in known if kind.__module__.startswith("tral_fsm.estimation") and not issubclass(kind, tuple)
    ] == []


def test_the_estimator_knows_no_commands_and_no_laws() -> None:
    known = [thing for thing in vars(estimator).values() if hasattr(thing, "__module__")]
    assert known
    assert [thing for thing in known if thing.__module__.startswith("tral_fsm.control")] == []


@pytest.mark.parametrize("name", ["office", "wall", "corridor"])
def test_a_machine_leaves_the_estimator_and_its_estimate_as_they_were(name: str) -> None:
    machine, estimator, speed_controller = Machine(load_machine(name)), Estimator(), SpeedController()
    command, visited = IDLE, set()

    def act(observation: np.ndarray) -> np.ndarray:
        nonlocal command
        estimate = estimator.update(observation.tolist(), command.steering_trim, command.target)
        before = pickle.dumps((estimator, estimate))
        command = machine.tick(estimate)
        assert pickle.dumps((estimator, estimate)) == before
        visited.add(machine.active_path)
        steering = (command.steering or 0.0) + estimator.steering_offset
        return np.array([steering, speed_controller.throttle(command, estimate.speed)], np.float32).clip(-1.0, 1.0)

    world = toy.corner("left", 2.0, trim=0.03)
    world.drive(act, 6.0)
    assert world.driven > 2.0
    assert len(visited) > 1 or name == "wall"
