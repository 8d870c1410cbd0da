"""The trained policies of the package: they are small, they say where they come from, and they drive."""

from pathlib import Path

import numpy as np
import pytest

from tral_env.env import TralCorridorEnv
from tral_env.errors import MachineError
from tral_env.policy_file import load_network
from tral_fsm import load_policy
from tral_fsm.formats import library
from tral_fsm.policies import trained
from tral_fsm.policies.families import EVERYWHERE, MACHINES, machine_for

NAMES = trained.names()


def test_there_are_a_student_one_of_ppo_and_a_residual() -> None:
    assert NAMES == ("ppo", "residual", "student")
    assert not set(NAMES) & set(library.names())


def test_together_they_are_small() -> None:
    files = [file for name in NAMES for file in Path(trained.path_of(name)).iterdir()]
    assert sum(file.stat().st_size for file in files) < 2_000_000


@pytest.mark.parametrize("name", NAMES)
def test_it_says_where_it_comes_from(name: str) -> None:
    about = load_network(trained.path_of(name)).provenance
    assert about["training_seeds"] == "100000 and up"
    assert about["validation_seeds"].startswith("500")
    assert about["curve"][-1]["steps"] >= about["steps"]
    assert {"python", "numpy"} <= about["host"]["versions"].keys() | about["host"].keys()
    assert about["request"]["scenarios"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("scenario", ["straight", "corners"])
def test_it_drives(name: str, scenario: str) -> None:
    policy, env = load_policy(name), TralCorridorEnv(scenario=scenario)
    observation, info = env.reset(seed=500)
    for _ in range(8 * 80):
        observation, _, terminated, truncated, info = env.step(policy.act(observation))
        if terminated or truncated:
            break
    env.close()
    assert not info["collision"]
    assert info["progress"] > 0.15


def test_a_name_that_is_mistyped_gets_the_nearest_one() -> None:
    with pytest.raises(MachineError, match="did you mean 'student'"):
        load_policy("studnet")


def test_a_path_stays_what_it_is() -> None:
    assert trained.path_of("runs/student") == "runs/student"


def test_each_family_has_its_machine_and_several_have_the_office() -> None:
    assert [machine_for([family]) for family in MACHINES] == [*MACHINES.values()]
    assert set(MACHINES.values()) | {EVERYWHERE} <= set(library.names())
    assert machine_for(["office"]) == machine_for(["corners", "gates"]) == EVERYWHERE


def test_it_answers_a_batch_of_cars() -> None:
    policy = load_policy("student")
    policy.reset(3)
    readings = np.stack([TralCorridorEnv(scenario="straight").reset(seed=seed)[0] for seed in (500, 501, 502)])
    assert policy.act(readings).shape == (3, 2)
