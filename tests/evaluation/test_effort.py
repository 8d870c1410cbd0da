"""What was spent to prepare an agent is read from the files beside it; what no file tells is unknown."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tral_env.errors import ConfigError
from tral_env.learned import Correction, Network
from tral_env.learner import LearnerConfig, LearnerView
from tral_env.policy_file import digest, save
from tral_fsm.evaluation.effort import Effort, of_file, of_policy, verdict


def network(**provenance: Any) -> Network:
    learner = LearnerConfig(decision_hz=20)
    weights = np.zeros((2, LearnerView(learner, 1).size), np.float32)
    return Network(learner=learner, layers=[(weights, np.zeros(2, np.float32))], provenance=provenance)


def test_a_machine_without_a_file_beside_it_tells_nothing(tmp_path: Path) -> None:
    assert of_file(tmp_path / "mine.json") == Effort()


def test_a_search_tells_its_drives_their_simulated_time_and_its_own(tmp_path: Path) -> None:
    (tmp_path / "tune.json").write_text('{"drives": 3000, "simulated_s": 36000.0, "seconds": 90.0, "trials": 9}')
    assert of_file(tmp_path / "machine.json") == Effort(drives=3000, simulated_h=10.0, minutes=1.5)
    assert of_file(tmp_path / "other.json") == Effort()


def test_the_time_of_a_search_that_was_resumed_is_unknown(tmp_path: Path) -> None:
    (tmp_path / "tune.json").write_text('{"drives": 30, "simulated_s": 3600, "seconds": 90.0, "resumed": true}')
    assert of_file(tmp_path / "machine.json") == Effort(drives=30, simulated_h=1.0)


def test_an_older_search_tells_no_simulated_time(tmp_path: Path) -> None:
    (tmp_path / "tune.json").write_text('{"drives": 30, "seconds": 60.0}')
    assert of_file(tmp_path / "machine.json") == Effort(drives=30, minutes=1.0)


def test_a_policy_tells_the_decisions_until_it_was_the_best(tmp_path: Path) -> None:
    got = of_policy(tmp_path, network(steps=144_000, seconds=90.0))
    assert got == Effort(decisions=144_000, simulated_h=2.0, minutes=1.5)  # 20 decisions a second


def test_the_curve_of_a_training_tells_how_long_it_went_on(tmp_path: Path) -> None:
    (tmp_path / "curve.json").write_text('[{"steps": 10, "seconds": 1}, {"steps": 288000, "seconds": 180.0}]')
    got = of_policy(tmp_path / "policy.json", network(steps=10, seconds=1.0))
    assert got == Effort(decisions=288_000, simulated_h=4.0, minutes=3.0)


def test_a_network_of_unknown_making_tells_nothing(tmp_path: Path) -> None:
    assert of_policy(tmp_path, network(steps="many")) == Effort()


def test_a_training_that_went_on_has_the_effort_of_both(tmp_path: Path) -> None:
    save(network(steps=72_000, seconds=60.0), tmp_path / "student")
    start = {"request": {"start": str(tmp_path / "student")}, "start_sha256": digest(tmp_path / "student")}
    later = network(steps=144_000, seconds=30.0, **start)
    assert of_policy(tmp_path / "ppo", later) == Effort(decisions=216_000, simulated_h=3.0, minutes=1.5)
    lost = network(steps=144_000, seconds=30.0, request={"start": str(tmp_path / "gone")})
    assert of_policy(tmp_path / "ppo", lost) == Effort()


def test_another_policy_in_the_place_of_the_start_counts_nothing(tmp_path: Path) -> None:
    save(network(steps=72_000, seconds=60.0), tmp_path / "student")
    told = digest(tmp_path / "student")
    save(network(steps=10, seconds=1.0), tmp_path / "student")
    later = network(steps=144_000, request={"start": str(tmp_path / "student")}, start_sha256=told)
    assert of_policy(tmp_path / "ppo", later) == Effort()


def test_a_training_that_says_it_went_on_from_itself_is_unknown(tmp_path: Path) -> None:
    round_about = network(steps=72_000, seconds=60.0, request={"start": str(tmp_path)})
    save(round_about, tmp_path)
    assert of_policy(tmp_path, round_about) == Effort()


def test_what_a_network_has_from_a_machine_is_told(tmp_path: Path) -> None:
    assert of_policy(tmp_path, network(teacher="office")).note == "taught by office, whose effort is not counted"
    corrected = replace(
        network(), learner=LearnerConfig(decision_hz=20), correction=Correction(machine="{}", steering=0.1, speed=0.1)
    )
    assert of_policy(tmp_path, corrected).note == "corrects a machine, whose effort is not counted"


def test_its_author_adds_what_no_program_knows(tmp_path: Path) -> None:
    (tmp_path / "mine.effort.json").write_text('{"tried": 12, "simulated_h": 30, "note": "gains by hand"}')
    assert of_file(tmp_path / "mine.json") == Effort(tried=12, simulated_h=30, note="gains by hand")
    (tmp_path / "effort.json").write_text('{"tried": 4}')
    assert of_policy(tmp_path, network(steps=72_000)) == Effort(decisions=72_000, simulated_h=1.0, tried=4)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"hours": 3}', "unknown entry 'hours'"),
        ('{"tried": 1.5}', "tried = 1.5: expected a whole number, 0 or more, or null"),
        ('{"minutes": -1}', "minutes = -1: expected a number, 0 or more, or null"),
        ('{"minutes": NaN}', "minutes = nan: expected a number"),
        ('{"drives": true}', "drives = True: expected a whole number"),
        ('{"note": 3}', "note = 3: expected a text"),
        ("[]", "expected an object with some of drives, decisions"),
        ("{", "tells no effort"),
    ],
)
def test_a_file_that_tells_no_effort_is_refused_with_its_name(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "mine.effort.json").write_text(text)
    with pytest.raises(ConfigError, match=message) as caught:
        of_file(tmp_path / "mine.json")
    assert "mine.effort.json" in str(caught.value)


@pytest.mark.parametrize("text", ["3", "{"])
def test_damaged_figures_of_a_search_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "tune.json").write_text(text)
    with pytest.raises(ConfigError, match=r"tune\.json"):
        of_file(tmp_path / "machine.json")


def hours(*values: float | None) -> list[Effort]:
    return [Effort(simulated_h=value) for value in values]


@pytest.mark.parametrize(
    ("field", "told"),
    [
        ([], ""),
        ([("mine", hours(3.0))], ""),
        ([("mine", hours(3.0)), ("ppo", hours(3.0, 3.6))], "The budgets are equal, in simulated time of each agent: "
         "mine 3 h, ppo 3.3 h."),
        ([("mine", hours(0.1)), ("ppo", hours(3.0))], "The budgets are not equal, in simulated time of each agent: "
         "mine 0.1 h, ppo 3 h."),
        ([("office", hours(None)), ("ppo", hours(3.0, None)), ("sac", hours(3.0))], "Whether the budgets are equal is "
         "unknown: no file tells the simulated time of office, ppo."),
    ],
)  # fmt: skip
def test_budgets_are_equal_unequal_or_unknown(field: list[tuple[str, list[Effort]]], told: str) -> None:
    assert verdict(field) == told


def test_an_effort_is_plain_in_json() -> None:
    assert json.loads(json.dumps(Effort(drives=3).record()))["drives"] == 3
