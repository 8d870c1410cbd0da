"""The tables of docs/deploy.md, from the results of `deploy_twin.py`.

python benchmarks/deploy_table.py benchmarks/results/deploy_*.json
"""

from __future__ import annotations

import json
import statistics
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

Drives = Sequence[Mapping[str, Any]]
SIMULATED = ("simulation", "together")
"""The simulation with sonars as they are drawn, and with sonars that fire together, as those of the twin do."""
CARS = {"pca9685": "I2C", "board2016": "serial, board2016", "ucboard": "serial, ucboard"}
"""Board -> its name in the tables."""


def load(paths: Iterable[Path]) -> dict[str, Drives]:
    """Drives by board, and the simulated ones."""
    reports = [json.loads(path.read_text("utf-8")) for path in paths]
    return {report["board"]: report["drives"] for report in reports}


def arrived(drive: Mapping[str, Any]) -> bool:
    """Whether a drive came to its goal."""
    return bool(drive["success"] if "success" in drive else drive["ended"] == "success")


def same(simulated: Drives, drives: Drives) -> Drives:
    """The simulated drives of the same courses, in the same order."""
    by_course = {(drive["scenario"], drive["seed"]): drive for drive in simulated}
    return [by_course[drive["scenario"], drive["seed"]] for drive in drives]


def success_table(found: Mapping[str, Drives]) -> str:
    """Success and gates passed of each car on each family, beside those of the simulation on the same courses."""
    lines = [
        "| car | family | on the twin | in simulation | sonars together | gates | in simulation | sonars together |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for board, name in CARS.items():
        for scenario in dict.fromkeys(drive["scenario"] for drive in found.get(board, ())):
            drives = [drive for drive in found[board] if drive["scenario"] == scenario]
            sides = [drives, *(same(found[each], drives) for each in SIMULATED)]
            total = sum(drive["gates_total"] for drive in sides[1])
            passed = [f"{sum(drive['gates_passed'] for drive in side)} of {total}" if total else "-" for side in sides]
            came = [f"{sum(map(arrived, side))} of {len(side)}" for side in sides]
            lines.append(f"| {' | '.join([name, scenario, *came, *passed])} |")
    return "\n".join(lines)


def loop_table(found: Mapping[str, Drives]) -> str:
    """Rate and lateness of the loop, and what the camera saw."""
    lines = [
        "| car | drives | rate | late ticks | late by: p50 | p99 | max | images | gates seen | in simulation |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for board, name in CARS.items():
        if not (drives := found.get(board, ())):
            continue
        ticks, beside = sum(drive["ticks"] for drive in drives), same(found[SIMULATED[0]], drives)
        late = {each: [drive["lateness_ms"][each] for drive in drives] for each in ("p50", "p99", "max")}
        cells = [
            name,
            str(len(drives)),
            f"{ticks / sum(drive['drive_s'] for drive in drives):.1f} Hz",
            f"{sum(drive['late_ticks'] for drive in drives) / ticks:.1%}",
            f"{statistics.median(late['p50']):.1f} ms",
            f"{statistics.median(late['p99']):.1f} ms",
            f"{max(late['max']):.0f} ms",
            str(sum(drive["images"] for drive in drives)),
            *(str(sum(drive["gates_seen"] for drive in each)) for each in (drives, beside)),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    results = load(map(Path, sys.argv[1:]))
    print(success_table(results), loop_table(results), sep="\n\n")
