"""Options of `tral tune`, and what is asked for once they are read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from tral_fsm.evaluation.choices import Camera, Randomization
from tral_fsm.evaluation.seeds import parse_seeds

if TYPE_CHECKING:
    from tral_fsm.tuning import Objective, Settings, Task

Sampler = Literal["cmaes", "tpe", "nsga2", "random"]
Pooling = Literal["mean", "worst", "cvar"]

Policy = Annotated[str, typer.Option(help="Packaged machine, or a file.")]
Scenarios = Annotated[str, typer.Option(help="Families of courses, with commas.")]
Params = Annotated[
    str, typer.Option(help="Which parameters, with commas: state[3].p, follow.p, *.p; =LOW:HIGH gives a range.")
]
Tie = Annotated[bool, typer.Option("--tie", help="All that one pattern names share one value.")]
Budget = Annotated[int, typer.Option(min=1, help="Drives that the search may cost.")]
Seeds = Annotated[str, typer.Option(help="FIRST:END of the courses of the search, each family has them.")]
ReportSeeds = Annotated[str, typer.Option(help="FIRST:END of the courses of the held-out check; none: no check.")]
Randomized = Annotated[Randomization, typer.Option(help="How much cars and sensors differ.")]
Cameras = Annotated[Camera, typer.Option(help="Projected is faster.")]
Pooled = Annotated[Pooling, typer.Option(help="How the costs of drives become one; cvar: worst quarter.")]
Objectives = Annotated[str, typer.Option(help="For a Pareto front, with --sampler nsga2: clearance,time,steering.")]
Samplers = Annotated[Sampler, typer.Option(help="cmaes; the others are Optuna's (extra `tune`).")]
Population = Annotated[int | None, typer.Option(min=4, help="Candidates in a generation.")]
SamplerSeed = Annotated[int, typer.Option(min=0, help="Of the sampler.")]
Processes = Annotated[int | None, typer.Option(min=1, help="How many work at once; default: all cores.")]
Storage = Annotated[
    str | None, typer.Option(help="Database URL or journal file: any number of processes on one study.")
]
Out = Annotated[Path, typer.Option(file_okay=False, help="Folder of the study, the machine, the report.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with the study in the folder.")]
SaveAs = Annotated[
    Path | None, typer.Option("--save", dir_okay=False, help="Write the machine here too, in the suffix's format.")
]
Grid = Annotated[
    int, typer.Option(min=0, max=40, help="Points along a side of the report's plane of cost; 0: no plane.")
]
Classical = Annotated[
    bool, typer.Option("--classical", help="Print classical gains and the margins of the machine's; no search.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Write tune.json to stdout too, and nothing else.")]


@dataclass(frozen=True, kw_only=True)
class TuneArguments:
    """What was asked for."""

    policy: str
    params: list[str]
    tie: bool
    task: Task
    objective: Objective
    settings: Settings
    processes: int
    storage: str | None
    out: Path
    resume: bool
    save_as: Path | None
    grid: int


def listed(text: str) -> list[str]:
    """Names with commas between them."""
    return [name.strip() for name in text.split(",") if name.strip()]


def task_of(scenario: str, seeds: str, randomization: Randomization, camera: Camera) -> Task:
    """What each candidate drives.

    Raises:
        ConfigError: one of the options is none that can be driven.
    """
    from tral_fsm.tuning import Task

    return Task(
        scenarios=tuple(listed(scenario)), seeds=tuple(parse_seeds(seeds)), randomization=randomization, camera=camera
    )


def settings_of(
    budget: int, sampler: Sampler, objectives: str, population: int | None, report_seeds: str, seed: int
) -> Settings:
    """How to search.

    Raises:
        ConfigError: one of the options cannot be, or not beside another.
    """
    from tral_fsm.tuning import Settings

    return Settings(
        budget=budget,
        sampler=sampler,
        objectives=tuple(listed(objectives)),
        population=population,
        report_seeds=() if report_seeds == "none" else tuple(parse_seeds(report_seeds, "--report-seeds")),
        seed=seed,
    )
