"""The tables of docs/ros.md, from the results of `ros.py`.

python benchmarks/ros_table.py benchmarks/results/ros.json
"""

from __future__ import annotations

import json
import statistics
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

Results = Sequence[Mapping[str, Any]]
PARTS = {"lock-step": "simulation, lock-step", "real-time": "simulation, real time", "twin": "twin, real time"}
"""Part of the results -> its name in the tables."""
FAMILIES = ("gates", "corners", "office")
VICTIMS = {
    "camera-frozen": "camera frozen", "camera-gone": "camera gone", "worker": "worker of the actuator",
    "keeper": "keeper of the actuator",
}  # fmt: skip


def load(path: Path) -> dict[str, Results]:
    """Results by part."""
    return {part: found["results"] for part, found in json.loads(path.read_text("utf-8")).items()}


def success_table(found: Mapping[str, Results]) -> str:
    """Success through ROS and in the plain environment, on the same courses."""
    lines = [
        "| car | run | gates | corners | office | plain environment | load |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for part, name in PARTS.items():
        for run in sorted({each["run"] for each in found[part]}):
            drives = [each for each in found[part] if each["run"] == run]
            cells = [_arrived([each for each in drives if each["family"] == family], "ros") for family in FAMILIES]
            loads = [each["load"] for each in drives]
            cells += [_arrived(drives, "plain"), f"{min(loads):.0f} to {max(loads):.0f}"]
            lines.append(f"| {name} | {run} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _arrived(drives: Results, side: str) -> str:
    return f"{sum(each[side]['success'] for each in drives)} of {len(drives)}"


def age_table(found: Mapping[str, Results]) -> str:
    """Ages of ranges at the policy, beside those in the plain environment."""
    lines = ["| car | p50 | p99 | plain environment: p50 | p99 |", "| --- | --- | --- | --- | --- |"]
    for part in ("real-time", "twin"):
        cells = [
            statistics.median(each[side]["age_ms"][share] for each in found[part])
            for side in ("ros", "plain")
            for share in ("p50", "p99")
        ]
        lines.append(f"| {PARTS[part]} | {' | '.join(f'{value:.0f} ms' for value in cells)} |")
    return "\n".join(lines)


def loss_table(found: Mapping[str, Results]) -> str:
    """What came late or never; nodes count on from drive to drive of a family, so the last one has all."""
    lines = ["| car | what | of | late | lost | refused |", "| --- | --- | --- | --- | --- | --- |"]
    for part in ("real-time", "twin"):
        last = {(each["family"], each["run"]): each["ros"]["nodes"] for each in found[part]}.values()
        car, fsm = (
            {name: sum(int(nodes[node][name]) for nodes in last) for name in names}
            for node, names in (
                ("/car: commands", ("ticks", "commands", "late commands", "lost commands", "refused commands",
                                    "ticks without an answer")),
                ("/fsm: readings", ("ticks answered", "late ticks", "skipped ticks", "readings", "lost messages",
                                    "refused readings")),
            )
        )  # fmt: skip
        name = PARTS[part]
        lines += [
            f"| {name} | commands at `car` | {car['commands']} | {car['late commands']} | {car['lost commands']} "
            f"| {car['refused commands']} |",
            f"| {name} | ticks of `car` without an answer in time | {car['ticks']} | {car['ticks without an answer']} "
            "| - | - |",
            f"| {name} | ticks at `fsm` | {fsm['ticks answered']} | {fsm['late ticks']} | {fsm['skipped ticks']} | - |",
            f"| {name} | readings at `fsm` | {fsm['readings']} | - | {fsm['lost messages']} "
            f"| {fsm['refused readings']} |",
        ]
    return "\n".join(lines)


def kill_table(found: Mapping[str, Results]) -> str:
    """Times from a fault until neutral, until no pulses and until standstill."""
    lines = [
        "| car | killed | neutral after | no pulses after | it stands after | armed again, it moves after |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for each in found["kill"]:
        times = [_milliseconds(each.get(name)) for name in ("neutral_ms", "off_ms")]
        stands, moves = (
            "-" if value is None else f"{value:.1f} s"
            for value in (each["stands_ms"] and each["stands_ms"] / 1e3, each["moves_after_arming_s"])
        )
        victim = VICTIMS.get(each["killed"], f"`{each['killed']}`")
        lines.append(f"| {each['car']} | {victim} | {' | '.join(times)} | {stands} | {moves} |")
    return "\n".join(lines)


def _milliseconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.0f} ms"


TABLES = (success_table, age_table, loss_table, kill_table)

if __name__ == "__main__":
    results = load(Path(sys.argv[1]))
    print(*(table(results) for table in TABLES), sep="\n\n")
