"""From the records of a comparison to its figures: what compare.json holds, and what its page shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_fsm.evaluation.composite import pace_mps, score, steering_per_m
from tral_fsm.evaluation.records import Record
from tral_fsm.evaluation.statistics import (
    Estimate,
    agent_choices,
    course_counts,
    iqm,
    mean_of,
    optimality_gap,
    percentile_interval,
    performance_profile,
    probability_of_improvement,
    resampled_scores,
    wilson,
)
from tral_fsm.evaluation.suites import Suite
from tral_fsm.evaluation.summary import rmse_of, summarize

Array = NDArray[np.float64]
LEVELS = np.round(np.linspace(0.0, 1.0, 41), 3)
"""Scores at which the performance profiles are told."""
LAST_POSES = 40
"""Of a drive that failed, so many of its last poses are kept: 4 s."""
MAX_FAILURES = 12
"""The gallery holds at most so many failures. Source: choice; they are to be looked at."""


class Scores:
    """Scores and successes of one contender with their resamples."""

    def __init__(
        self,
        drives: Mapping[tuple[str, str, str, int], Record],
        agents: Sequence[str],
        suite: Suite,
        counts: Array,
        rng: np.random.Generator,
    ) -> None:
        """Put the records in their places.

        Args:
            drives: agent, level, family, seed -> record.
            agents: the agents, a.
            suite: its t tasks and c courses.
            counts: (b, t, c) courses of the resamples, the same for all contenders.
            rng: draws the agents of the resamples.
        """
        shape = len(agents), len(suite.tasks), len(suite.seeds)
        rows = [
            drives[agent, level, family, seed]
            for agent in agents
            for family, level in suite.tasks
            for seed in suite.seeds
        ]
        self.rows = rows
        self.score = np.array([score(row) for row in rows]).reshape(shape)
        self.success = np.array([row["success"] for row in rows], float).reshape(shape)
        self._counts, self._choice = counts, agent_choices(len(agents), rng, len(counts))
        self.tasks = self.score.mean(axis=2)
        """(a, t) score matrix."""
        self.resampled = self.resample(self.score)
        """(b, a, t) score matrices of the resamples."""

    def resample(self, values: Array) -> Array:
        """Means of values (a, t, c) in each resample, (b, a, t)."""
        return resampled_scores(values, self._counts, self._choice)

    def estimate(self, values: Array) -> Estimate:
        """Mean of values (a, t, c) with its interval."""
        return percentile_interval(values.mean(), self.resample(values).mean(axis=(1, 2)))

    def success_rate(self) -> Estimate:
        """Success rate; its interval is the wider one of Wilson's over the drives and the bootstrap's."""
        got = self.estimate(self.success)
        assert got.low is not None
        assert got.high is not None
        low, high = wilson(int(self.success.sum()), self.success.size)
        return Estimate(value=got.value, low=min(low, got.low), high=max(high, got.high))


def analyse(
    lines: Sequence[Record], suite: Suite, field: Sequence[Mapping[str, Any]], seed: int = 0, resamples: int = 2000
) -> dict[str, Any]:
    """Figures of a comparison, ready for JSON.

    Args:
        lines: lines of runs and drives; all drives of the suite and the field are there.
        suite: the courses.
        field: records of the contenders (`Contender.record`).
        seed: seed of the bootstrap.
        resamples: number of resamples.
    """
    rng = np.random.default_rng(seed)
    counts = course_counts(len(suite.tasks), len(suite.seeds), rng, resamples)
    drives = {name: {} for name in (one["name"] for one in field)}  # type: dict[str, dict[Any, Record]]
    for line in lines:
        if line["kind"] == "drive":
            drives[line["contender"]][line["agent"], line["level"], line["scenario"], line["seed"]] = line
    scores = {
        one["name"]: Scores(drives[one["name"]], [each["source"] for each in one["agents"]], suite, counts, rng)
        for one in field
    }
    return {
        "suite": suite.record(),
        "statistics": {"seed": seed, "resamples": resamples},
        "contenders": [{**one, "figures": figures(scores[one["name"]])} for one in field],
        "tasks": tasks(scores, suite),
        "profiles": profiles(scores),
        "pairs": pairs(scores),
        "paths": paths(scores, suite),
        "failures": failures(scores, field),
        "runs": [line["host"] for line in lines if line["kind"] == "run"],
    }


def figures(one: Scores) -> dict[str, Any]:
    """Figures of a contender over all tasks: those of scores with intervals, the others over all of its drives."""
    summary = summarize(one.rows)
    offsets = np.array([offset for row in one.rows for offset in row["gate_offsets_m"]])
    travel = [each for each in map(steering_per_m, one.rows) if each is not None]
    drives = len(one.rows)
    return {
        "drives": drives,
        "success": asdict(one.success_rate()),
        "score": asdict(one.estimate(one.score)),
        "iqm": asdict(percentile_interval(float(iqm(one.tasks)), iqm(one.resampled))),
        "gap": asdict(percentile_interval(float(optimality_gap(one.tasks)), optimality_gap(one.resampled))),
        "progress": asdict(one.estimate(_shaped(one, "progress"))),
        "collision_rate": summary.collisions / drives,
        "crash_rate": summary.crashes / drives,
        "missed_gate_rate": summary.missed_gates / drives,
        "timeout_rate": summary.timeouts / drives,
        "gates_passed": summary.gates_passed,
        "gates_total": summary.gates_total,
        "gate_offset_rms_m": float(np.sqrt((offsets**2).mean())) if offsets.size else None,
        "settled_rmse_m": rmse_of(one.rows, "settled"),
        "time_s": asdict(mean_of([row["time_s"] for row in one.rows if row["success"]])),
        "pace_mps": sum(map(pace_mps, one.rows)) / drives,
        "mean_speed_mps": summary.mean_speed_mps,
        "steering_per_m": float(np.mean(travel)) if travel else None,
        "agent_scores": one.tasks.mean(axis=1).round(4).tolist(),
    }


def _shaped(one: Scores, name: str) -> Array:
    """Values of the records as (a, t, c)."""
    return np.array([row[name] for row in one.rows], float).reshape(one.score.shape)


def tasks(scores: Mapping[str, Scores], suite: Suite) -> list[dict[str, Any]]:
    """Success and score of each contender on each task; the interval of the success is Wilson's over its drives."""
    found = []
    for k, (family, level) in enumerate(suite.tasks):
        cells = {}
        for name, one in scores.items():
            won, trials = int(one.success[:, k].sum()), one.success[:, k].size
            low, high = wilson(won, trials)
            cells[name] = {
                "successes": won, "drives": trials, "low": low, "high": high, "score": float(one.tasks[:, k].mean())
            }  # fmt: skip
        found.append({"family": family, "level": level, "contenders": cells})
    return found


def profiles(scores: Mapping[str, Scores]) -> dict[str, Any]:
    """Share of each contender's drives whose score is above each level, with 95 % bands."""
    shown: dict[str, Any] = {"levels": LEVELS.tolist(), "contenders": {}}
    for name, one in scores.items():
        above = [one.resample((one.score > level).astype(float)).mean(axis=(1, 2)) for level in LEVELS]
        low, high = np.percentile(np.array(above), (2.5, 97.5), axis=1)
        value = performance_profile(one.score, LEVELS)
        shown["contenders"][name] = {
            "value": value.round(5).tolist(), "low": low.round(5).tolist(), "high": high.round(5).tolist()
        }  # fmt: skip
    return shown


def pairs(scores: Mapping[str, Scores]) -> list[dict[str, Any]]:
    """Differences of each two contenders on the courses that they share, and how likely the first one is better."""
    found = []
    for first, second in combinations(scores, 2):
        x, y = scores[first], scores[second]
        found.append(
            {
                "first": first,
                "second": second,
                "success": asdict(_difference(x, y, x.success, y.success)),
                "score": asdict(_difference(x, y, x.score, y.score)),
                "improvement": asdict(
                    percentile_interval(
                        float(probability_of_improvement(x.tasks, y.tasks)),
                        probability_of_improvement(x.resampled, y.resampled),
                    )
                ),
                "time_ratio": asdict(time_ratio(x, y)),
            }
        )
    return found


def _difference(x: Scores, y: Scores, of_x: Array, of_y: Array) -> Estimate:
    """Mean of x minus mean of y; both drive the same courses in each resample."""
    resampled = x.resample(of_x).mean(axis=(1, 2)) - y.resample(of_y).mean(axis=(1, 2))
    return percentile_interval(of_x.mean() - of_y.mean(), resampled)


def time_ratio(x: Scores, y: Scores) -> Estimate:
    """Time of x over that of y where all agents of both arrive: geometric mean over those courses."""
    both = x.success.all(axis=0) & y.success.all(axis=0)
    logs = np.log(_shaped(x, "time_s").mean(axis=0)[both] / _shaped(y, "time_s").mean(axis=0)[both])
    got = mean_of(logs.tolist())
    return Estimate(**{name: None if value is None else float(np.exp(value)) for name, value in asdict(got).items()})


def paths(scores: Mapping[str, Scores], suite: Suite) -> list[dict[str, Any]]:
    """Paths of all contenders over the first course of each task, those of their first agents."""
    shown = []
    for k, (family, level) in enumerate(suite.tasks):
        rows = {name: one.rows[k * len(suite.seeds)] for name, one in scores.items()}
        cars = {name: {"outcome": row["outcome"], "path": row["path"]} for name, row in rows.items()}
        shown.append({"family": family, "level": level, "seed": suite.seeds[0], "contenders": cars})
    return shown


def failures(scores: Mapping[str, Scores], field: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Last seconds of some failures: the contenders in turn, each with a failure of another task where it has one."""
    floors = {one["name"] for one in field if all(agent["source"] in ("constant", "random") for agent in one["agents"])}
    queues = []
    for name, one in scores.items():
        if name in floors:
            continue
        seen: dict[tuple[str, str], list[Record]] = {}
        for row in one.rows:
            if not row["success"]:
                seen.setdefault((row["level"], row["scenario"]), []).append(row)
        waiting = [list(rows) for rows in seen.values()]
        turns = [
            rows[turn] for turn in range(max(map(len, waiting), default=0)) for rows in waiting if turn < len(rows)
        ]
        queues.append(turns)
    longest = max(map(len, queues), default=0)
    chosen = [queue[turn] for turn in range(longest) for queue in queues if turn < len(queue)][:MAX_FAILURES]
    kept = ("contender", "agent", "level", "scenario", "seed", "outcome", "crash", "time_s", "progress")
    return [{**{name: row[name] for name in kept}, "path": row["path"][-LAST_POSES:]} for row in chosen]
