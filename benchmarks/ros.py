"""A policy drives the simulated car and the twin through processes of ROS 2 over loopback, and in the plain env too.

    python benchmarks/ros.py --part lock-step --out benchmarks/results/ros.json
    nice -n -10 python benchmarks/ros.py --part real-time --seeds 1000,1001,1008,1009,1014,1015 --out ...
    nice -n -10 python benchmarks/ros.py --part twin --seeds 1000,1008,1009,1014 --out ...
    nice -n -10 python benchmarks/ros.py --part kill --out ...

The processes are `tral ros car`, `tral ros fsm` and, on the twin, `tral ros camera`. This program resets and arms
the car by messages, and hears what it tells. The courses are those of `deploy_twin.py`. In lock-step each tick waits
for its answer, so that a busy computer changes nothing, and no ages are measured. The age of a range at the policy is
the time from its stamp until a command is here. "kill" ends each node in turn in the middle of a drive instead, on the
simulated car and on the twin (`ros_kill.py`). Each result is written as it comes; the script begins where its file
ends.
"""

from __future__ import annotations

import argparse
import fcntl
import json
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from deploy_twin import FAMILIES, FIRST_SEED
from ros_probe import Probe, processes

from tral_fsm import load_policy
from tral_fsm.evaluation.files import prepare_folder
from tral_fsm.evaluation.host import host

POLICY = "office"
DRIVES = ("lock-step", "real-time", "twin")
PATIENCE_S = {"lock-step": 3600.0, "real-time": 300.0, "twin": 300.0}
"""A drive has ended after this time, or it counts as broken."""
SIDES = ("left", "front", "right")


def commands_of(part: str, family: str, seed: int) -> list[list[str]]:
    """Command lines of the nodes."""
    car = ["car", "--scenario", family, "--seed", str(seed)]
    if part == "lock-step":
        return [[*car, "--lock-step"], ["fsm", "--policy", POLICY, "--use-sim-time"]]
    if part == "real-time":
        return [car, ["fsm", "--policy", POLICY]]
    return [[*car, "--backend", "twin", "--camera", "rendered"], ["camera"], ["fsm", "--policy", POLICY]]


def drive(probe: Probe, part: str, seed: int) -> dict[str, Any]:
    """One drive through ROS."""
    before = probe.lost()
    probe.begin(seed)
    until_s = time.monotonic() + PATIENCE_S[part]
    while probe.armed and time.monotonic() < until_s:
        probe.hear(0.05)
    until_s = time.monotonic() + 5.0
    while time.monotonic() < until_s and not (probe.result and len(probe.figures) > 1):
        probe.hear(0.05)
    told = probe.result or {"success": False, "ended": probe.why}
    if part != "lock-step":
        told |= {"age_ms": percentiles(probe.ages_ms)}
    lost = {topic: count - before[topic] for topic, count in probe.lost().items()}
    return {**told, "messages": dict(probe.counts), "lost": lost, "nodes": dict(probe.figures)}


def drive_plain(family: str, seed: int, camera: str) -> dict[str, Any]:
    """The same course and car in the plain environment."""
    env = gym.make("tral_env:TralCorridor-v0", scenario=family, camera=camera, groups=("imu", "battery"))
    policy = load_policy(POLICY)
    policy.reset()
    observation, _ = env.reset(seed=seed)
    layout = env.unwrapped.world.layout  # type: ignore[attr-defined]
    columns = [layout.column(f"ultrasonic_{side}_age") for side in SIDES]
    ages_ms: list[float] = []
    ended = False
    while not ended:
        observation, _, terminated, truncated, info = env.step(policy.act(observation))
        ages_ms += (observation[columns] * 1e3).tolist()
        ended = terminated or truncated
    env.close()
    told = {name: np.asarray(info[name]).item() for name in ("success", "progress", "time_s", "gates_passed")}
    return told | {"age_ms": percentiles(ages_ms)}


def percentiles(values: Sequence[float]) -> dict[str, float]:
    """Median and 99th percentile."""
    found = np.percentile(values or [np.nan], [50, 99]).tolist()
    return dict(zip(("p50", "p99"), found, strict=True))


def drives(part: str, courses: Sequence[tuple[str, int]]) -> Iterator[dict[str, Any]]:
    """Drives on courses, those of a family by the same processes."""
    for family in dict.fromkeys(family for family, _ in courses):
        seeds = [seed for each, seed in courses if each == family]
        with processes(*commands_of(part, family, seeds[0])):
            probe = Probe()
            for seed in seeds:
                one: dict[str, Any] = {"family": family, "seed": seed, "nice": os.nice(0)}
                one["ros"] = drive(probe, part, seed)
                one["load"] = os.getloadavg()[0]
                yield one
            probe.node.close()


def with_plain(part: str, made: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Drives with those of the plain environment beside them; in real time these come after all others."""
    camera = "rendered" if part == "twin" else "projected"
    found = made if part == "lock-step" else list(made)
    for one in found:
        yield one | {"plain": drive_plain(one["family"], one["seed"], camera)}


def courses_of(families: str, first_seed: int, wanted: str) -> list[tuple[str, int]]:
    """Family and seed of each course."""
    found, seed = [], first_seed
    for each in families.split(","):
        family, number = each.split(":")
        found += [(family, one) for one in range(seed, seed + int(number))]
        seed += int(number)
    only = {int(one) for one in wanted.split(",") if one}
    return [course for course in found if not only or course[1] in only]


def keep(out: Path, part: str, one: dict[str, Any]) -> None:
    """Add a result to the file, or replace the one of its course; other parts may be written meanwhile."""
    with out.open("a+") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        report = json.loads(out.read_text() or "{}")
        kept = report.setdefault(part, {"host": {}, "results": []})
        kept["host"] = host()
        same = ("family", "seed", "run", "car", "killed")
        kept["results"] = [old for old in kept["results"] if any(old.get(name) != one.get(name) for name in same)]
        kept["results"].append(one)
        out.write_text(json.dumps(report, indent=1))
    print(json.dumps(one), flush=True)


def done(out: Path, part: str) -> list[dict[str, Any]]:
    """Results of a part that the file has."""
    report = json.loads(out.read_text()) if out.exists() else {}
    found: list[dict[str, Any]] = report.get(part, {"results": []})["results"]
    return found


def main() -> None:
    """Measure what has no result yet."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--part", choices=(*DRIVES, "kill"), required=True)
    parser.add_argument("--families", default=FAMILIES, help="family:number of courses, ...")
    parser.add_argument("--seed", type=int, default=FIRST_SEED)
    parser.add_argument("--seeds", default="", help="only the courses of these seeds")
    parser.add_argument("--run", type=int, default=1, help="number of this run of the part: in real time they differ")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    prepare_folder(given.out.parent)
    if given.part == "kill":
        from ros_kill import kills

        known = [(each["car"], each["killed"]) for each in done(given.out, "kill")]
        for one in kills(known):
            keep(given.out, "kill", one)
        return
    done_before = [each for each in done(given.out, given.part) if "plain" in each and each["run"] == given.run]
    known = [(each["family"], each["seed"]) for each in done_before]
    courses = [each for each in courses_of(given.families, given.seed, given.seeds) if each not in known]
    made = ({**one, "run": given.run} for one in drives(given.part, courses))
    noted = (keep(given.out, given.part, one) or one for one in made) if given.part != "lock-step" else made
    for one in with_plain(given.part, noted):
        keep(given.out, given.part, one)


if __name__ == "__main__":
    main()
