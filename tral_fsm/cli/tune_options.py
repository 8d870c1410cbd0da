"""Options of `tral tune`, and what a search makes of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tral_fsm.evaluation.choices import Camera, Randomization, families, listed
from tral_fsm.evaluation.seeds import parse_seeds
from tral_fsm.tuning.choices import Pooling, Sampler

if TYPE_CHECKING:
    from tral_fsm.tuning import Settings, Task

Policy = Annotated[str, typer.Option(help="Name of a packaged machine, or a machine file.")]
Scenarios = Annotated[str, typer.Option(help="Families of courses, separated by commas, or all.")]
Course = Annotated[
    str | None,
    typer.Option(help="Tune on one course instead of families: a name that `tral courses` lists, or a course file."),
]
Params = Annotated[
    str | None,
    typer.Option(
        help="Parameters, separated by commas: state[3].p, follow.p, *.p; =LOW:HIGH gives a range. Default: the gains "
        "p, i, d of all states; of a machine without gains the speeds of its states."
    ),
]
ListParams = Annotated[
    bool, typer.Option("--list-params", help="List the parameters of the machine with their ranges; no search.")
]
Tie = Annotated[bool, typer.Option("--tie", help="Give all parameters of one pattern the same value.")]
Budget = Annotated[int, typer.Option(min=1, help="Largest number of drives of the search.")]
Seeds = Annotated[str, typer.Option(help="Seeds FIRST:END of the search; each family is driven with each.")]
ReportSeeds = Annotated[str, typer.Option(help="Seeds FIRST:END of the check on new courses; none: no check.")]
Randomized = Annotated[Randomization, typer.Option(help="How much cars and sensors differ from seed to seed.")]
Cameras = Annotated[
    Camera, typer.Option(help="Render the camera's image, or project the markers: faster, without OpenGL.")
]
Pooled = Annotated[
    Pooling,
    typer.Option(help="Cost of a candidate: mean of its drives, worst drive, or cvar, the mean of the worst quarter."),
]
Objectives = Annotated[
    str, typer.Option(help="Two or three of clearance,time,steering for a Pareto front; needs --sampler nsga2.")
]
Samplers = Annotated[Sampler, typer.Option(help="Method of the search; all but cmaes need the extra `tune`.")]
Population = Annotated[
    int | None, typer.Option(min=4, help="Candidates of a generation; default: 12, more beyond 20 parameters.")
]
SamplerSeed = Annotated[int, typer.Option(min=0, help="Seed of the sampler.")]
Processes = Annotated[int | None, typer.Option(min=1, help="Number of processes; default: one for each core.")]
ClusterAddress = Annotated[
    str | None,
    typer.Option("--cluster", metavar="ADDRESS", help="Dask scheduler whose workers drive; needs the extra `cluster`."),
]
Storage = Annotated[
    str | None, typer.Option(help="Database URL or journal file through which several commands share one study.")
]
Out = Annotated[Path, typer.Option(file_okay=False, help="Folder of the study, the machine and the report.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with the study in the folder.")]
SaveAs = Annotated[
    Path | None,
    typer.Option("--save", dir_okay=False, help="Write the machine to this file too, in the format of its suffix."),
]
Grid = Annotated[
    int,
    typer.Option(
        min=0, max=40, help="Points along a side of the report's plot of cost over two parameters; 0: no plot."
    ),
]
Classical = Annotated[
    bool,
    typer.Option(
        "--classical", help="Print gains of classical control and the margins of the machine's own; no search."
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON and nothing else; the files are written too.")]


@dataclass(frozen=True, kw_only=True)
class TuneOptions:
    """What stands on the command line of `tral tune`, in the order of its help."""

    policy: Policy = "wall"
    scenario: Scenarios = "straight"
    course: Course = None
    params: Params = None
    list_params: ListParams = False
    tie: Tie = False
    budget: Budget = 3000
    seeds: Seeds = "0:8"
    report_seeds: ReportSeeds = "500:600"
    randomization: Randomized = "default"
    camera: Cameras = "projected"
    objective: Pooled = "mean"
    objectives: Objectives = ""
    sampler: Samplers = "cmaes"
    population: Population = None
    seed: SamplerSeed = 0
    processes: Processes = None
    cluster: ClusterAddress = None
    storage: Storage = None
    out: Out = Path("runs/tune")
    resume: Resume = False
    save_as: SaveAs = None
    grid: Grid = 9
    classical: Classical = False
    as_json: AsJson = False


def task_of(given: TuneOptions) -> Task:
    """The drives of each candidate.

    Raises:
        ConfigError: an option cannot be driven, or the seeds are those of test courses.
        CourseError: the course file is none.
    """
    from tral_env.options import as_course
    from tral_fsm.evaluation.suites import require_no_test_seeds
    from tral_fsm.tuning import Task

    parsed = tuple(parse_seeds(given.seeds))
    if given.course is None:
        require_no_test_seeds(parsed, "--seeds")
    return Task(
        scenarios=(Path(given.course).stem,) if given.course is not None else tuple(families(given.scenario)),
        seeds=parsed,
        randomization=given.randomization,
        camera=given.camera,
        course=as_course(given.course),
    )


def settings_of(given: TuneOptions) -> Settings:
    """The settings of the search.

    Raises:
        ConfigError: an option is out of its range, or does not go with another.
    """
    from tral_fsm.tuning import Settings

    return Settings(
        budget=given.budget,
        sampler=given.sampler,
        objectives=tuple(listed(given.objectives)),
        population=given.population,
        report_seeds=() if given.report_seeds == "none" else tuple(parse_seeds(given.report_seeds, "--report-seeds")),
        seed=given.seed,
    )
