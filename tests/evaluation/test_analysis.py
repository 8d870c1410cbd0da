"""Figures of a comparison from hand-made records."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import pytest
from courses import drive

from tral_fsm.evaluation.analysis import MAX_FAILURES, analyse
from tral_fsm.evaluation.effort import Effort
from tral_fsm.evaluation.suites import Suite
from tral_fsm.evaluation.terms import terms

SUITE = Suite(name="two", families=("straight", "gates"), levels=("none",), split="validation", courses=4)


def _agent(source: str, simulated_h: float | None = 2.0) -> dict[str, Any]:
    return {"source": source, "effort": None if source == "random" else asdict(Effort(simulated_h=simulated_h))}


FIELD = [
    {"name": "good", "agents": [_agent("good")]},
    {"name": "learner", "agents": [_agent("a"), _agent("b")]},
    {"name": "random", "agents": [_agent("random")]},
]


def line(contender: str, agent: str, family: str, seed: int, outcome: str, **changes: Any) -> dict[str, Any]:
    """A drive of 10 m in 10 s; one that fails ends halfway."""
    half = {} if outcome == "success" else {"progress": 0.5, "time_s": 5.0}
    others = {"seed": seed, "scenario": family, "steering_travel": 0.0, **half, **changes}
    offsets = [0.03, -0.04] if family == "gates" else []
    told = {"kind": "drive", "contender": contender, "agent": agent, "level": "none", "gate_offsets_m": offsets}
    return told | drive(outcome, **others).record() | {"path": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]] * 30}


def lines() -> list[dict[str, Any]]:
    """`good` arrives; agent a fails on `gates`, agent b on one course of each family; `random` fails."""
    found: list[dict[str, Any]] = [{"kind": "run", "host": {"cpu": "any"}}]
    for family in SUITE.families:
        for seed in SUITE.seeds:
            found += [
                line("good", "good", family, seed, "success"),
                line("learner", "a", family, seed, "timeout" if family == "gates" else "success", time_s=20.0),
                line("learner", "b", family, seed, "missed_gate" if seed == 501 else "success"),
                line("random", "random", family, seed, "collision"),
            ]
    return found


@pytest.fixture(scope="module")
def shown() -> dict[str, Any]:
    return analyse(lines(), SUITE, FIELD, seed=1, resamples=300)


def figures(shown: dict[str, Any], name: str) -> dict[str, Any]:
    return next(one["figures"] for one in shown["contenders"] if one["name"] == name)


def test_rates_are_shares_of_all_drives_of_all_agents(shown: dict[str, Any]) -> None:
    learner = figures(shown, "learner")
    assert learner["drives"] == 16
    assert learner["success"]["value"] == 10 / 16
    assert (learner["timeout_rate"], learner["missed_gate_rate"], learner["collision_rate"]) == (4 / 16, 2 / 16, 0.0)
    assert figures(shown, "random")["collision_rate"] == 1.0


def test_a_perfect_record_has_the_interval_of_wilson(shown: dict[str, Any]) -> None:
    good = figures(shown, "good")["success"]
    assert (good["value"], good["high"]) == (1.0, 1.0)
    assert good["low"] == pytest.approx(0.6756, abs=1e-4)


def test_two_agents_that_differ_make_a_wide_interval(shown: dict[str, Any]) -> None:
    learner = figures(shown, "learner")["success"]
    assert learner["low"] <= 0.5
    assert learner["high"] >= 0.8


def test_the_iqm_is_taken_over_agents_and_tasks(shown: dict[str, Any]) -> None:
    # Agent a at 0.5 m/s scores most on straights, at gates (at 0.25 m/s) least; agent b in between on both.
    a_straight, a_gates, b_score = 1.0 - 0.2 / 3, 0.5 * 0.7 * 0.8, (3.0 + 0.5 * 0.7) / 4
    learner = figures(shown, "learner")
    assert learner["iqm"]["value"] == pytest.approx(b_score)
    assert learner["agent_scores"] == pytest.approx([(a_straight + a_gates) / 2, b_score], abs=1e-4)


def test_figures_of_gates_and_way(shown: dict[str, Any]) -> None:
    good = figures(shown, "good")
    assert good["gate_offset_rms_m"] == pytest.approx(((0.03**2 + 0.04**2) / 2) ** 0.5)
    assert good["pace_mps"] == 1.0
    assert good["steering_per_m"] == 0.0
    assert good["time_s"]["value"] == 10.0
    assert good["settled_rmse_m"] == 0.02


def test_a_task_is_a_family_on_a_level(shown: dict[str, Any]) -> None:
    straight, gates = shown["tasks"]
    assert (straight["family"], gates["family"]) == ("straight", "gates")
    cell = gates["contenders"]["learner"]
    assert (cell["successes"], cell["drives"]) == (3, 8)


def test_a_pair_tells_difference_and_probability(shown: dict[str, Any]) -> None:
    first = shown["pairs"][0]
    assert (first["first"], first["second"]) == ("good", "learner")
    assert first["success"]["value"] == pytest.approx(6 / 16)
    assert first["improvement"]["value"] == 1.0
    # Agent a arrives on 4 straights in 20 s each, agent b on 6 courses in 10 s each.
    assert first["time_ratio"]["value"] == pytest.approx(0.5**0.4)
    assert len(shown["pairs"]) == 3


def test_a_profile_falls_from_one_end_to_the_other(shown: dict[str, Any]) -> None:
    good = shown["profiles"]["contenders"]["good"]
    assert good["value"][:-1] == [1.0] * (len(good["value"]) - 1)
    assert good["value"][-1] == 0.0  # no score is above 1
    random = shown["profiles"]["contenders"]["random"]
    assert all(
        low <= value <= high for low, value, high in zip(random["low"], random["value"], random["high"], strict=True)
    )


def test_the_gallery_takes_turns_and_leaves_out_the_floors(shown: dict[str, Any]) -> None:
    failures = shown["failures"]
    assert {one["contender"] for one in failures} == {"learner"}
    assert {one["scenario"] for one in failures[:2]} == {"straight", "gates"}
    assert len(failures) <= MAX_FAILURES
    assert all(len(one["path"]) == 40 for one in failures)


def test_the_paths_are_those_of_the_first_course(shown: dict[str, Any]) -> None:
    assert [(one["family"], one["seed"]) for one in shown["paths"]] == [("straight", 500), ("gates", 500)]
    assert set(shown["paths"][0]["contenders"]) == {"good", "learner", "random"}


def test_the_same_seed_gives_the_same_intervals(shown: dict[str, Any]) -> None:
    assert analyse(lines(), SUITE, FIELD, seed=1, resamples=300) == shown
    assert analyse(lines(), SUITE, FIELD, seed=2, resamples=300)["contenders"] != shown["contenders"]


MANY = Suite(name="many", families=("straight",), levels=("none",), split="validation", courses=100)
THREE = [
    {"name": "machine", "agents": [_agent("m")]},
    {"name": "learner", "agents": [_agent("a"), _agent("b"), _agent("c")]},
]


def of_three(**c: Any) -> dict[str, Any]:
    """A machine that takes 10 s, and agents that take 6 s, 10 s, and what `c` says, on 100 straights."""
    found: list[dict[str, Any]] = []
    for seed in MANY.seeds:
        found += [
            line("machine", "m", "straight", seed, "success"),
            line("learner", "a", "straight", seed, "success", time_s=6.0),
            line("learner", "b", "straight", seed, "success", time_s=10.0),
            line("learner", "c", "straight", seed, **c),
        ]
    return analyse(found, MANY, THREE, resamples=200)


def test_the_unit_of_a_cell_of_the_tasks_is_the_agent() -> None:
    """Over 300 drives Wilson's interval is 61 to 72 %; over agents of 100, 100 and 0 % it is nearly all."""
    shown = of_three(outcome="collision")
    cell = shown["tasks"][0]["contenders"]["learner"]
    assert (cell["successes"], cell["drives"], cell["low"], cell["high"]) == (200, 300, 0.0, 1.0)
    machine = shown["tasks"][0]["contenders"]["machine"]
    assert (machine["low"], machine["high"]) == pytest.approx((0.963, 1.0), abs=1e-3)


def test_the_unit_of_the_time_is_the_agent() -> None:
    """Over 300 drives the interval of the mean of 12 s is 11.4 to 12.6 s."""
    time = figures(of_three(outcome="success", time_s=20.0), "learner")["time_s"]
    assert time["value"] == pytest.approx(12.0)
    assert time["low"] < 6.0
    assert time["high"] > 20.0


def test_the_time_ratio_is_the_geometric_mean_over_pairs_of_agents() -> None:
    (pair,) = of_three(outcome="success", time_s=20.0)["pairs"]
    ratio = pair["time_ratio"]
    assert ratio["value"] == pytest.approx((10.0 / 6.0 * 10.0 / 10.0 * 10.0 / 20.0) ** (1 / 3))
    assert ratio["low"] < 0.5
    assert ratio["high"] > 10.0 / 6.0


def test_the_time_ratio_needs_no_agent_that_never_arrives() -> None:
    (pair,) = of_three(outcome="collision")["pairs"]
    assert pair["time_ratio"]["value"] == pytest.approx((10.0 / 6.0) ** 0.5)


def test_nothing_that_arrives_has_no_time(shown: dict[str, Any]) -> None:
    assert figures(shown, "random")["time_s"] == {"value": None, "low": None, "high": None}


def test_one_course_has_no_interval_but_that_of_wilson() -> None:
    one = replace(SUITE, courses=1)
    shown = analyse(lines(), one, FIELD, resamples=50)
    good = figures(shown, "good")
    assert (good["iqm"]["low"], good["score"]["high"], good["time_s"]["low"]) == (None, None, None)
    assert good["success"]["low"] == pytest.approx(0.342, abs=1e-3)
    assert shown["pairs"][0]["success"]["low"] is None
    assert shown["profiles"]["contenders"]["good"]["low"] == shown["profiles"]["contenders"]["good"]["value"]


def test_budgets_and_terms_are_told(shown: dict[str, Any]) -> None:
    """`random` needs none; both agents of `learner` had 2 h, as `good` had."""
    assert shown["budgets"] == "The budgets are equal, in simulated time of each agent: good 2 h, learner 2 h."
    values = {one["term"]: one["values"] for one in shown["terms"]}
    assert values["time limit of a course"] == ["route / (0.3 m/s) + 10 s"]
    assert values["from command to pulse"] == ["20 ms"]


def test_delays_are_told_for_each_level() -> None:
    rows = terms(replace(SUITE, levels=("default", "hard")))
    values = {one["term"]: one["values"] for one in rows}
    assert values["from command to pulse"] == ["10 to 40 ms", "10 to 80 ms"]
    assert values["from exposure to detection"][0] == "20 to 60 ms"
    assert values["readings and commands"] == ["80 a second"] * 2
