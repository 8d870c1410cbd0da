"""How well does each reference machine drive the family that it is made for, and `office` all families?

    python benchmarks/machines.py --seeds 2000:2200 --out now.jsonl
    python benchmarks/machines.py --seeds 2000:2200 --folder old_machines --out before.jsonl
    python benchmarks/machines.py --table before.jsonl now.jsonl

The script appends each drive to the file as it ends; started again, it goes on where it stopped.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from run_settings import ClusterAddress

from tral_env.course.generate import SCENARIOS
from tral_env.errors import TralError
from tral_fsm import load_machine
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.batch import BatchRunner
from tral_fsm.evaluation.choices import Randomization, families
from tral_fsm.evaluation.cluster import Workers
from tral_fsm.evaluation.episode import EpisodeRequest
from tral_fsm.evaluation.pool import stop_check
from tral_fsm.evaluation.records import digest, drive_missing, read_lines
from tral_fsm.evaluation.seeds import parse_seeds, stretches
from tral_fsm.evaluation.summary import rmse_of, summarize
from tral_fsm.policies.families import EVERYWHERE, MACHINES, machine_for
from tral_fsm.terminal import drives_bar

COLUMNS = ["family", "machine", "file", "arrived", "95 %", "collisions", "missed", "RMSE cm", "settled cm", "m/s", "s"]
CHUNK = 64
"""Number of drives in a batch."""
Record = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class MachinesSettings:
    """Settings of all drives of a file."""

    folder: str
    camera: str
    randomization: str


def main(
    files: Annotated[list[Path] | None, typer.Argument(help="Files to show beside each other, with --table.")] = None,
    seeds: Annotated[str, typer.Option(help="Seeds FIRST:END.")] = "2000:2200",
    scenarios: Annotated[str, typer.Option(help="Families, separated by commas, or all.")] = "all",
    folder: Annotated[str, typer.Option(help="Folder of machine files that drive instead of the packaged ones.")] = "",
    randomization: Randomization = "default",
    own: Annotated[bool, typer.Option(help="Drive only the machine of each family, not `office` on all.")] = False,
    processes: Annotated[int, typer.Option(min=1)] = 2,
    cluster: ClusterAddress = None,
    out: Path = Path("benchmarks/results/machines.jsonl"),
    table: Annotated[bool, typer.Option(help="Print the table of the files, and drive nothing.")] = False,
) -> None:
    """Drive seeds x families with their machines and print a table."""
    try:
        if not table:
            settings = MachinesSettings(folder=folder, camera="projected", randomization=randomization)
            drive(jobs(families(scenarios), parse_seeds(seeds), own=own), settings, cluster or processes, out)
        print(markdown(files or [out]))
    except TralError as error:
        raise SystemExit(f"Error: {error}") from None


def jobs(scenarios: Iterable[str], seeds: range, *, own: bool) -> dict[str, list[tuple[str, int]]]:
    """Machine and seed of all drives, by family: its machine, and `office` too unless `own`."""
    machines = {
        scenario: sorted({machine_for([scenario])} | (set() if own else {EVERYWHERE})) for scenario in scenarios
    }
    return {scenario: [(name, seed) for seed in seeds for name in names] for scenario, names in machines.items()}


def drive(
    wanted: Mapping[str, Sequence[tuple[str, int]]], settings: MachinesSettings, processes: Workers, out: Path
) -> None:
    """Drive what the file does not hold yet, and append each drive as it ends.

    Raises:
        ConfigError: the file was made with other settings, or other machines.
        TralError: a machine cannot be read; no file is begun then.
    """
    drivers = {name: digest(machine(name, settings)) for name in sorted({*MACHINES.values(), EVERYWHERE})}
    drive_missing(
        wanted,
        batch,
        lambda line: (line["scenario"], (line["machine"], line["seed"])),
        out=out,
        settings=settings,
        machines=drivers,
        chunk=CHUNK,
        processes=processes,
        bar=drives_bar,
    )


def machine(name: str, settings: MachinesSettings) -> MachineDefinition:
    """A machine of the folder, or the packaged one."""
    return load_machine(Path(settings.folder) / f"{name}.json" if settings.folder else name)


def batch(scenario: str, wanted: Sequence[tuple[str, int]], settings: MachinesSettings) -> list[Record]:
    """Records of drives, given as machine and seed, on one family."""
    names = sorted({name for name, _ in wanted})
    machines = [machine(name, settings) for name in names]
    requests = [EpisodeRequest(names.index(name), scenario, seed) for name, seed in wanted]
    camera, level = settings.camera, settings.randomization
    with BatchRunner([scenario], rows=len(wanted), camera=camera, randomization=level) as runner:
        drives = runner.drive(machines, requests, stop_check())
    return [{"kind": "drive", "machine": name} | each.record() for (name, _), each in zip(wanted, drives, strict=True)]


def markdown(files: Iterable[Path]) -> str:
    """The files beside each other as Markdown tables: each family with its machine, then `office` on the others."""
    made = {path.stem: drives_of(path) for path in files}
    out = [f"{name}: seeds {stretches({r['seed'] for r in records})}" for name, records in made.items()]
    for own in (True, False):
        out += ["", f"| {' | '.join(COLUMNS)} |", "| --- | --- | ---" + " | ---:" * (len(COLUMNS) - 3) + " |"]
        for scenario in SCENARIOS:
            machine = machine_for([scenario]) if own else EVERYWHERE
            for name, records in made.items():
                found = [r for r in records if r["scenario"] == scenario and r["machine"] == machine]
                if found and (own or machine != machine_for([scenario])):
                    out.append(row([scenario, machine, name], found))
    return "\n".join(out)


def drives_of(path: Path) -> list[Record]:
    """Records of a file's drives."""
    return [line for line in read_lines(path) if line["kind"] == "drive"]


def row(names: Sequence[str], records: Sequence[Record]) -> str:
    """One line of the table."""
    figures = summarize(records)
    cells = [
        *names,
        f"{figures.successes}/{figures.episodes}",
        f"{100 * figures.success_low:.1f} to {100 * figures.success_high:.1f}",
        f"{figures.collisions}",
        f"{figures.missed_gates}",
        centimetres(records, "clearance"),
        centimetres(records, "settled"),
        f"{figures.mean_speed_mps:.2f}",
        "-" if figures.time_s is None else f"{figures.time_s:.1f}",
    ]
    return f"| {' | '.join(cells)} |"


def centimetres(records: Sequence[Mapping[str, Any]], kind: str) -> str:
    """RMSE over all measured ticks of all drives, cm."""
    rmse = rmse_of(records, kind)
    return "-" if rmse is None else f"{100 * rmse:.1f}"


if __name__ == "__main__":
    typer.run(main)
