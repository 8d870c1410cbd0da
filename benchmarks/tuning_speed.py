"""How many drives a minute does `tral tune` simulate, and how much of the time is bare `Batch.step`?

    python benchmarks/tuning_speed.py --out benchmarks/results/tuning_speed.json

Run it on an idle computer; the result tells the load before it.
"""

from __future__ import annotations

import os
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from tral_env.errors import ConfigError, TralError
from tral_fsm import load_machine
from tral_fsm.evaluation.batch import MAX_ROWS, BatchRunner
from tral_fsm.evaluation.choices import check_families
from tral_fsm.evaluation.episode import EpisodeRequest
from tral_fsm.evaluation.files import prepare_folder, write_json
from tral_fsm.evaluation.host import host
from tral_fsm.evaluation.pool import ProcessPool, spawned, worker_losses
from tral_fsm.terminal import print_figures

SEEDS = 8
"""Number of courses that all candidates share, as in a search."""
BUSY = 0.3
"""Load before the measurement from which on the figures say little."""


@dataclass(frozen=True, kw_only=True)
class Share:
    """Measurements of one process."""

    drives: int
    simulated_s: float
    began: float
    """Start on the clock that all processes share, s."""
    ended: float
    """End on the same clock, s."""
    step_s: float
    """Time in `Batch.step`, s."""
    cpu_s: float
    """CPU time, s."""


class Timed:
    """A batch that measures the time of its steps."""

    def __init__(self, batch: Any) -> None:
        self._batch, self.seconds = batch, 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._batch, name)

    def step(self, *args: Any, **kwargs: Any) -> None:
        """Step the batch."""
        began = time.perf_counter()
        self._batch.step(*args, **kwargs)
        self.seconds += time.perf_counter() - began


def measure(policy: str, scenario: str, drives: int, rows: int, ready: Any = None) -> Share:
    """Drive once all processes are ready; the time to build the simulation and the courses does not count."""
    machine = load_machine(policy)
    jobs = [EpisodeRequest(0, scenario, k % SEEDS) for k in range(drives)]
    runner = BatchRunner([scenario], rows=rows, stuck_s=10.0)
    for job in jobs[:SEEDS]:
        runner.draw(job)
    physics = runner.prepare(drives).sim.physics
    physics.batch = timed = Timed(physics.batch)
    if ready is not None:
        ready.wait()
    began, cpu = time.monotonic(), time.process_time()
    done = runner.drive([machine], jobs)
    return Share(
        drives=len(done),
        simulated_s=sum(each.time_s for each in done),
        began=began,
        ended=time.monotonic(),
        step_s=timed.seconds,
        cpu_s=time.process_time() - cpu,
    )


_ready: Any = None


def _begin(ready: Any) -> None:
    global _ready
    _ready = ready


def _measure(policy: str, scenario: str, drives: int, rows: int) -> Share:
    return measure(policy, scenario, drives, rows, _ready)


def figures(shares: list[Share]) -> dict[str, float]:
    """Figures of all processes together, from the first start to the last end."""
    seconds = max(each.ended for each in shares) - min(each.began for each in shares)
    drives, simulated = sum(each.drives for each in shares), sum(each.simulated_s for each in shares)
    at_work = sum(each.ended - each.began for each in shares)
    return {
        "seconds": seconds,
        "drives": drives,
        "simulated_s_per_drive": simulated / drives,
        "drives_per_minute": 60.0 * drives / seconds,
        "drives_of_20_s_per_minute": 3.0 * simulated / seconds,
        "minutes_for_5000_drives_of_20_s": 5000.0 * seconds / (3.0 * simulated),
        "share_in_batch_step": sum(each.step_s for each in shares) / at_work,
        "share_of_a_core": sum(each.cpu_s for each in shares) / at_work,
    }


def pairs(text: str) -> list[tuple[str, str]]:
    """Pairs of machine and family in a text MACHINE:FAMILY,..."""
    found = []
    for pair in text.split(","):
        policy, _, scenario = pair.rpartition(":")
        if not policy:
            raise ConfigError(f"--policies {pair}: expected MACHINE:FAMILY, such as wall:straight")
        check_families([scenario])
        found.append((policy, scenario))
    return found


def main(
    policies: Annotated[str, typer.Option(help="Pairs MACHINE:FAMILY, separated by commas.")] = (
        "wall:straight,office:office"
    ),
    drives: Annotated[int, typer.Option(min=1, help="Number of drives in each process.")] = 384,
    processes: Annotated[int, typer.Option(min=1)] = os.cpu_count() or 1,
    rows: Annotated[int, typer.Option(min=1, help="Largest number of drives at once in each process.")] = MAX_ROWS,
    out: Path | None = None,
) -> None:
    """Measure drives a minute."""
    if out is not None:
        prepare_folder(out.parent)
    load = os.getloadavg()[0]
    if load > BUSY:
        Console(stderr=True).print(f"The computer is busy (load {load:.2f}): the figures say little.", style="red")
    table, results = Table(title=f"{processes} processes, {rows} drives at once in each"), []
    for heading in ("", "drives a minute", "of 20 s", "5000 of 20 s take", "in Batch.step", "of a core"):
        table.add_column(heading, justify="right" if heading else "left")
    for policy, scenario in pairs(policies):
        with ProcessPool(processes, _begin, spawned.Barrier(processes)) as pool, worker_losses():
            futures = [pool.submit(_measure, policy, scenario, drives, rows) for _ in range(processes)]
            shares = [each.result() for each in futures]
        found = figures(shares)
        results.append(
            {"policy": policy, "scenario": scenario, **found, "processes": [asdict(each) for each in shares]}
        )
        table.add_row(
            f"{policy} on {scenario}", f"{found['drives_per_minute']:.0f}", f"{found['drives_of_20_s_per_minute']:.0f}",
            f"{found['minutes_for_5000_drives_of_20_s']:.1f} min", f"{100 * found['share_in_batch_step']:.0f} %",
            f"{100 * found['share_of_a_core']:.0f} %",
        )  # fmt: skip
    print_figures(table)
    if out is not None:
        write_json(out, {"rows": rows, "load_before": load, "host": host(), "results": results})


if __name__ == "__main__":
    try:
        typer.run(main)
    except TralError as error:
        raise SystemExit(f"Error: {error}") from None
