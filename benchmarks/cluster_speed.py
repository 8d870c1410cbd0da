"""What does a search cost on a Dask cluster of this computer, beside as many processes of its own?

    python benchmarks/cluster_speed.py --out benchmarks/results/cluster_speed.json

Both drive the same candidates on the same courses, in turns, with workers that have started and built their courses.
The ratio of computing time says what the cluster adds; that of wall time also depends on what else the computer does.
"""

from __future__ import annotations

import os
import statistics
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import psutil
import typer
from distributed import LocalCluster
from rich.table import Table

from tral_env.errors import TralError
from tral_fsm import load_machine
from tral_fsm.evaluation.files import prepare_folder, write_json
from tral_fsm.evaluation.host import host
from tral_fsm.terminal import print_figures
from tral_fsm.tuning import Evaluator, Task


def computing_s() -> float:
    """Computing time of this process and of all processes that it has started and that still run, s."""
    here = psutil.Process()
    return sum(one.cpu_times().user + one.cpu_times().system for one in [here, *here.children(recursive=True)])


def measure(evaluator: Evaluator, machines: list[Any], task: Task) -> tuple[dict[str, float], list[Any]]:
    """Wall time and computing time of all drives, s, and their results."""
    began, cpu = time.monotonic(), computing_s()
    found = evaluator.on_courses(machines, task.courses)
    return {"seconds": time.monotonic() - began, "computing_s": computing_s() - cpu}, found


def main(
    policy: str = "wall",
    scenario: str = "straight",
    candidates: Annotated[int, typer.Option(min=1, help="Machines that drive each course.")] = 12,
    seeds: Annotated[int, typer.Option(min=1, help="Number of courses.")] = 8,
    workers: Annotated[int, typer.Option(min=1)] = 2,
    rounds: Annotated[int, typer.Option(min=1)] = 5,
    out: Path | None = None,
) -> None:
    """Measure both in turns."""
    if out is not None:
        prepare_folder(out.parent)
    load, task = os.getloadavg()[0], Task(scenarios=(scenario,), seeds=tuple(range(seeds)))
    machines = [load_machine(policy)] * candidates
    taken: dict[str, list[dict[str, float]]] = {"processes": [], "cluster": []}
    with ExitStack() as stack:
        local = LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None)
        address = stack.enter_context(local).scheduler_address
        field = {"processes": stack.enter_context(Evaluator(task, processes=workers))}
        field["cluster"] = stack.enter_context(Evaluator(task, processes=address))
        for k in range(rounds + 1):
            results = []
            for name, evaluator in field.items():
                figures, found = measure(evaluator, machines, task)
                results.append(found)
                if k:  # the first turn starts the workers
                    taken[name].append(figures)
            if results[0] != results[1]:
                raise TralError("a drive on the cluster differs from that of a process")
    show(
        taken, rounds, out, {"policy": policy, "scenario": scenario, "drives": candidates * seeds, "load_before": load}
    )


def show(taken: dict[str, list[dict[str, float]]], rounds: int, out: Path | None, about: dict[str, Any]) -> None:
    """Print medians, and write all."""
    table, results = Table(title=f"{about['drives']} drives, medians of {rounds} turns"), {}
    for heading in ("", "cluster", "processes", "ratio"):
        table.add_column(heading, justify="right" if heading else "left")
    for what in ("seconds", "computing_s"):
        there, here = (statistics.median(one[what] for one in taken[name]) for name in ("cluster", "processes"))
        ratio = statistics.median(a[what] / b[what] for a, b in zip(taken["cluster"], taken["processes"], strict=True))
        results[what] = {"cluster": there, "processes": here, "ratio": ratio}
        table.add_row(what.replace("_s", ", s"), f"{there:.2f}", f"{here:.2f}", f"{ratio:.2f}")
    print_figures(table)
    if out is not None:
        write_json(out, {**about, "host": host(), "results": results, "turns": taken})


if __name__ == "__main__":
    try:
        typer.run(main)
    except TralError as error:
        raise SystemExit(f"Error: {error}") from None
