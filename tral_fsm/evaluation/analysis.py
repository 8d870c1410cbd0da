"""From the records of a comparison to its figures: what compare.json holds, and what its page shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_fsm.evaluation.composite import pace_mps, score, steering_per_m
from tral_fsm.evaluation.effort import Effort, verdict
from tral_fsm.evaluation.intervals import Choice, Means, interval
from tral_fsm.evaluation.records import Record
from tral_fsm.evaluation.statistics import (
    Estimate,
    agent_choices,
    course_counts,
    iqm,
    optimality_gap,
    performance_profile,
    probability_of_improvement,
    wilson,
)
from tral_fsm.evaluation.suites import Suite
from tral_fsm.evaluation.summary import rmse_of, summarize
from tral_fsm.evaluation.terms import terms

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
        self.shape = shape
        self.score = np.array([score(row) for row in rows]).reshape(shape)
        self.success = np.array([row["success"] for row in rows], float).reshape(shape)
        self.time = self.values("time_s")
        self.counts, self.draws = counts, agent_choices(len(agents), rng, len(counts))
        self.tasks = self.score.mean(axis=2)
        """(a, t) score matrix."""
        self.score_means, self.success_means = Means(self.score, counts), Means(self.success, counts)

    def values(self, name: str) -> Array:
        """Values of the records as (a, t, c)."""
        return np.array([row[name] for row in self.rows], float).reshape(self.shape)

    def estimate(self, figure: Callable[[Array], Array], means: Means) -> Estimate:
        """A figure in [0, 1] of matrices (b, a, t) with its interval."""
        return within(self.shape, lambda resampled, agents: figure(means.of(resampled, agents[0])), self)

    def success_rate(self, task: int | None = None) -> Estimate:
        """Success rate, on one task or on all; its interval is also as wide as Wilson's over the courses."""
        part = slice(None) if task is None else slice(task, task + 1)
        shape = self.success[:, part].shape
        got = within(
            shape, lambda resampled, agents: _mean(self.success_means.of(resampled, agents[0])[:, :, part]), self
        )
        low, high = wilson(float(self.success[:, part].sum()) / shape[0], shape[1] * shape[2])
        if got.low is not None and got.high is not None:
            low, high = min(low, got.low), max(high, got.high)
        return Estimate(value=got.value, low=low, high=high)

    def time_s(self) -> Estimate:
        """Mean time of the drives that arrived, with its interval."""
        arrived = Means(self.success * self.time, self.counts)

        def mean(resampled: bool, agents: Sequence[Choice]) -> Array:
            times = arrived.of(resampled, agents[0]).sum(axis=(1, 2))
            return _ratio(times, self.success_means.of(resampled, agents[0]).sum(axis=(1, 2)))

        return within(self.shape, mean, self, bounds=(0.0, math.inf))


def within(
    shape: Sequence[int],
    figure: Callable[[bool, Sequence[Choice]], Array],
    *of: Scores,
    bounds: tuple[float, float] = (0.0, 1.0),
) -> Estimate:
    """Interval of a figure of some contenders over drives of a shape (a, t, c)."""
    return interval(figure, [one.draws for one in of], tasks=shape[1], courses=shape[2], bounds=bounds)


def _mean(matrices: Array) -> Array:
    """Mean of each of some matrices (b, a, t)."""
    mean: Array = matrices.mean(axis=(1, 2))
    return mean


def _ratio(of: Array, to: Array) -> Array:
    """Quotients; NaN where both are 0, because nothing arrived."""
    nothing = np.full(np.broadcast_shapes(of.shape, to.shape), np.nan)
    quotients: Array = np.divide(of, to, out=nothing, where=to > 0)
    return quotients


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
        "terms": terms(suite),
        "budgets": budgets(field),
        "statistics": {"seed": seed, "resamples": resamples},
        "contenders": [{**one, "figures": figures(scores[one["name"]])} for one in field],
        "tasks": tasks(scores, suite),
        "profiles": profiles(scores),
        "pairs": pairs(scores),
        "paths": paths(scores, suite),
        "failures": failures(scores, field),
        "runs": [line["host"] for line in lines if line["kind"] == "run"],
    }


def budgets(field: Sequence[Mapping[str, Any]]) -> str:
    """What `effort.verdict` says of the contenders that somebody prepared."""
    efforts = {
        one["name"]: [Effort(**agent["effort"]) for agent in one["agents"] if agent["effort"] is not None]
        for one in field
    }
    return verdict([(name, mine) for name, mine in efforts.items() if mine])


def figures(one: Scores) -> dict[str, Any]:
    """Figures of a contender over all tasks: those of scores with intervals, the others over all of its drives."""
    summary = summarize(one.rows)
    offsets = np.array([offset for row in one.rows for offset in row["gate_offsets_m"]])
    travel = [each for each in map(steering_per_m, one.rows) if each is not None]
    drives = len(one.rows)
    return {
        "drives": drives,
        "success": asdict(one.success_rate()),
        "score": asdict(one.estimate(_mean, one.score_means)),
        "iqm": asdict(one.estimate(iqm, one.score_means)),
        "gap": asdict(one.estimate(optimality_gap, one.score_means)),
        "progress": asdict(one.estimate(_mean, Means(one.values("progress"), one.counts))),
        "collision_rate": summary.collisions / drives,
        "crash_rate": summary.crashes / drives,
        "missed_gate_rate": summary.missed_gates / drives,
        "timeout_rate": summary.timeouts / drives,
        "gates_passed": summary.gates_passed,
        "gates_total": summary.gates_total,
        "gate_offset_rms_m": float(np.sqrt((offsets**2).mean())) if offsets.size else None,
        "settled_rmse_m": rmse_of(one.rows, "settled"),
        "time_s": asdict(one.time_s()),
        "pace_mps": sum(map(pace_mps, one.rows)) / drives,
        "mean_speed_mps": summary.mean_speed_mps,
        "steering_per_m": float(np.mean(travel)) if travel else None,
        "agent_scores": one.tasks.mean(axis=1).round(4).tolist(),
    }


def tasks(scores: Mapping[str, Scores], suite: Suite) -> list[dict[str, Any]]:
    """Success and score of each contender on each task."""
    found = []
    for k, (family, level) in enumerate(suite.tasks):
        cells = {}
        for name, one in scores.items():
            got = one.success_rate(k)
            cells[name] = {
                "successes": int(one.success[:, k].sum()),
                "drives": one.success[:, k].size,
                "low": got.low,
                "high": got.high,
                "score": float(one.tasks[:, k].mean()),
            }
        found.append({"family": family, "level": level, "contenders": cells})
    return found


def profiles(scores: Mapping[str, Scores]) -> dict[str, Any]:
    """Share of each contender's drives whose score is above each level, with 95 % bands."""
    shown: dict[str, Any] = {"levels": LEVELS.tolist(), "contenders": {}}
    for name, one in scores.items():
        above = [one.estimate(_mean, Means((one.score > level).astype(float), one.counts)) for level in LEVELS]
        shown["contenders"][name] = {
            "value": performance_profile(one.score, LEVELS).round(5).tolist(),
            "low": [_rounded(each.low, each.value) for each in above],
            "high": [_rounded(each.high, each.value) for each in above],
        }
    return shown


def _rounded(value: float | None, default: float | None) -> float:
    """An end of a band with five digits; where there is none, the band has no width."""
    known = default if value is None else value
    assert known is not None, "a share of drives is a number"
    return round(known, 5)


def pairs(scores: Mapping[str, Scores]) -> list[dict[str, Any]]:
    """Differences of each two contenders on the courses that they share, and how likely the first one is better."""
    found = []
    for first, second in combinations(scores, 2):
        x, y = scores[first], scores[second]
        found.append(
            {
                "first": first,
                "second": second,
                "success": asdict(_difference(x, y, x.success_means, y.success_means)),
                "score": asdict(_difference(x, y, x.score_means, y.score_means)),
                "improvement": asdict(improvement(x, y)),
                "time_ratio": asdict(time_ratio(x, y)),
            }
        )
    return found


def _difference(x: Scores, y: Scores, of_x: Means, of_y: Means) -> Estimate:
    """Mean of x minus mean of y; both drive the same courses in each resample."""
    return within(
        x.shape,
        lambda resampled, agents: _mean(of_x.of(resampled, agents[0])) - _mean(of_y.of(resampled, agents[1])),
        x,
        y,
        bounds=(-1.0, 1.0),
    )


def improvement(x: Scores, y: Scores) -> Estimate:
    """Probability that an agent of x scores more than one of y on a task."""
    return within(
        x.shape,
        lambda resampled, agents: probability_of_improvement(
            x.score_means.of(resampled, agents[0]), y.score_means.of(resampled, agents[1])
        ),
        x,
        y,
    )


def time_ratio(x: Scores, y: Scores) -> Estimate:
    """Time of x over that of y: geometric mean over pairs of an agent of each, and the courses on which both arrive."""
    both = x.success[:, None] * y.success[None]
    logs = both * (np.log(x.time)[:, None] - np.log(y.time)[None])
    sums = {False: (_course_sums(logs), _course_sums(both))}
    sums[True] = (_course_sums(logs, x.counts), _course_sums(both, x.counts))

    def ratio(resampled: bool, agents: Sequence[Choice]) -> Array:
        pairs = _times(agents[0], x.shape[0])[:, :, None] * _times(agents[1], y.shape[0])[:, None, :]
        log, number = ((one * pairs).sum(axis=(1, 2)) for one in sums[resampled])
        return _ratio(log, number)

    got = within(x.shape, ratio, x, y, bounds=(-math.inf, math.inf))
    return Estimate(**{name: None if value is None else math.exp(value) for name, value in asdict(got).items()})


def _course_sums(values: Array, counts: Array | None = None) -> Array:
    """Sums over courses of values (a, a', t, c) of pairs of agents: (1, a, a'), or (b, a, a') with counts (b, t, c)."""
    flat = values.reshape(*values.shape[:2], -1)
    each = np.ones((1, flat.shape[2])) if counts is None else counts.reshape(len(counts), -1)
    sums: Array = np.tensordot(each, flat, axes=(1, 2))
    return sums


def _times(agents: Choice, n: int) -> Array:
    """How often each of n agents is chosen, (b, n)."""
    times: Array = (agents[:, :, None] == np.arange(n)).sum(axis=1).astype(float)
    return times


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
