"""`tral tune`: a search for parameters of a machine, with a check on courses that the search has not seen."""

from __future__ import annotations

import contextlib
import json
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from tral_fsm.cli import tune_options as options
from tral_fsm.cli.console import refuse_both
from tral_fsm.cli.tune_show import Bar, kept_text, print_result, show_parameters
from tral_fsm.evaluation.choices import listed
from tral_fsm.programs.tune import TuneArguments, check, run

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tral_fsm.definition.machine import MachineDefinition


def command(
    context: typer.Context,
    policy: options.Policy = "wall",
    scenario: options.Scenarios = "straight",
    course: options.Course = None,
    params: options.Params = None,
    list_params: options.ListParams = False,
    tie: options.Tie = False,
    budget: options.Budget = 3000,
    seeds: options.Seeds = "0:8",
    report_seeds: options.ReportSeeds = "500:600",
    randomization: options.Randomized = "default",
    camera: options.Cameras = "projected",
    objective: options.Pooled = "mean",
    objectives: options.Objectives = "",
    sampler: options.Samplers = "cmaes",
    population: options.Population = None,
    seed: options.SamplerSeed = 0,
    processes: options.Processes = None,
    cluster: options.ClusterAddress = None,
    storage: options.Storage = None,
    out: options.Out = Path("runs/tune"),
    resume: options.Resume = False,
    save_as: options.SaveAs = None,
    grid: options.Grid = 9,
    classical: options.Classical = False,
    as_json: options.AsJson = False,
) -> None:
    """Search parameters of a machine, and check the result on courses that the search has not seen.

    The command writes machine.json, tune.json, report.html and study.jsonl into the folder. Ctrl-C keeps the results
    so far; --resume goes on.
    """
    from tral_fsm.cli.tune_classical import show_classical
    from tral_fsm.formats.library import load as load_machine
    from tral_fsm.tuning import Objective

    refuse_both(context, "scenario", "course")
    refuse_both(context, "processes", "cluster")
    machine = load_machine(policy)
    if classical:
        show_classical(machine, as_json=as_json)
        return
    if list_params:
        show_parameters(machine, as_json=as_json)
        return
    arguments = TuneArguments(
        policy=policy,
        params=_chosen(machine, params),
        tie=tie,
        task=options.task_of(scenario, course, seeds, randomization, camera),
        objective=Objective(pooling=objective),
        settings=options.settings_of(budget, sampler, objectives, population, report_seeds, seed),
        processes=cluster or processes or os.cpu_count() or 1,
        storage=storage,
        out=out,
        resume=resume,
        save_as=save_as,
        grid=grid,
        origin=_origin(),
    )
    check(arguments, machine)
    with _shown(arguments) as bar:
        tuned, report = run(arguments, machine, bar)
    if as_json:
        typer.echo(json.dumps(report, indent=2))
    else:
        print_result(tuned, out)


def _chosen(machine: MachineDefinition, params: str | None) -> list[str]:
    """Patterns of the parameters; those that the user did not name are said."""
    from tral_fsm.tuning.listing import default_patterns, listing

    if params is not None:
        return listed(params)
    chosen = default_patterns(machine)
    names = ", ".join(each.name for each in listing(machine) if each.is_default)
    typer.echo(f"Tuning {names} (--params chooses others, --list-params lists them).", err=True)
    return chosen


@contextlib.contextmanager
def _shown(arguments: TuneArguments) -> Iterator[Bar]:
    """A bar; at Ctrl-C it says what is kept."""
    with Bar() as bar:
        try:
            yield bar
        except KeyboardInterrupt:
            bar.stop()
            typer.echo(kept_text(bar.progress, arguments.out, arguments.storage), err=True)
            raise


def _origin() -> str:
    """The command line as files tell it, without the password of a database."""
    from tral_fsm.tuning.search.storage import masked

    arguments = sys.argv[1:]
    if arguments[:1] != ["tune"]:
        return "tral tune"
    return " ".join(["tral", *(shlex.quote(masked(each)) for each in arguments)])
