"""`tral tune`: a search for parameters of a machine, with a check on courses that the search has not seen."""

from __future__ import annotations

import contextlib
import json
import os
import shlex
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from tral_env.atomic import write_bytes
from tral_env.errors import ConfigError
from tral_env.perception import opengl
from tral_fsm.cli import tune_options as options
from tral_fsm.cli.tune_show import Bar, kept_text, print_result, show_parameters
from tral_fsm.evaluation.choices import listed
from tral_fsm.evaluation.files import prepare_folder, write_json
from tral_fsm.evaluation.host import versions
from tral_fsm.tuning.folder import MACHINE, NUMBERS, PAGE, RESULTS, STUDY

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tral_fsm.definition.machine import MachineDefinition
    from tral_fsm.tuning import Tuned


def command(
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

    machine = load_machine(policy)
    if classical:
        show_classical(machine, as_json=as_json)
        return
    if list_params:
        show_parameters(machine, as_json=as_json)
        return
    arguments = options.TuneArguments(
        policy=policy,
        params=_chosen(machine, params),
        tie=tie,
        task=options.task_of(scenario, course, seeds, randomization, camera),
        objective=Objective(pooling=objective),
        settings=options.settings_of(budget, sampler, objectives, population, report_seeds, seed),
        processes=processes or os.cpu_count() or 1,
        storage=storage,
        out=out,
        resume=resume,
        save_as=save_as,
        grid=grid,
    )
    tuned, report = run(arguments, machine)
    if as_json:
        typer.echo(json.dumps(report, indent=2))
    else:
        print_result(tuned, out)


def _chosen(machine: MachineDefinition, params: str | None) -> list[str]:
    """Patterns of the parameters; those that the user did not name are said."""
    from tral_fsm.tuning.listing import default_patterns

    if params is not None:
        return listed(params)
    chosen = default_patterns(machine)
    typer.echo(f"Tuning {', '.join(chosen)} (--params chooses others, --list-params lists them).", err=True)
    return chosen


def run(arguments: options.TuneArguments, machine: MachineDefinition) -> tuple[Tuned, dict[str, Any]]:
    """Search, check, and write all files.

    Args:
        arguments: the options.
        machine: the machine that is tuned.

    Returns:
        The result, and the content of tune.json.

    Raises:
        ConfigError: an option cannot be used; nothing is written then.
    """
    from tral_fsm.tuning import save

    _check(arguments, machine)
    prepare_folder(arguments.out)
    origin = _origin()
    with _shown(arguments) as bar:
        tuned = _tune(arguments, machine, origin, bar)
        asked = {
            "policy": arguments.policy,
            "task": arguments.task.record(),
            "settings": json.loads(json.dumps(asdict(arguments.settings))),
        }
        report = {"command": origin, **asked, "versions": versions(), **tuned.record()}
        write_json(arguments.out / NUMBERS, report)
        if arguments.save_as is not None:
            save(tuned, arguments.save_as, origin)
        _write_page(arguments, tuned, report, bar)
    return tuned, report


@contextlib.contextmanager
def _shown(arguments: options.TuneArguments) -> Iterator[Bar]:
    """A bar; at Ctrl-C it says what is kept."""
    with Bar() as bar:
        try:
            yield bar
        except KeyboardInterrupt:
            bar.stop()
            typer.echo(kept_text(bar.progress, arguments.out, arguments.storage), err=True)
            raise


def _check(arguments: options.TuneArguments, machine: MachineDefinition) -> None:
    """Refuse options that cannot be used, before an hour of driving and before anything is written."""
    from tral_fsm.formats import by_suffix
    from tral_fsm.tuning import check_apart, check_budget, find

    check_apart(arguments.task, arguments.settings)
    check_budget(arguments.task, arguments.settings)
    _check_files(arguments)
    find(machine, arguments.params, tie=arguments.tie)
    if arguments.task.camera == "rendered":
        opengl.require_loadable()
    if arguments.save_as is not None:
        by_suffix(arguments.save_as.suffix)
        prepare_folder(arguments.save_as.parent)


def _check_files(arguments: options.TuneArguments) -> None:
    """Refuse a folder where a result cannot be written, or would replace the machine that is tuned."""
    for name in (*RESULTS, STUDY):
        if (arguments.out / name).is_dir():
            raise ConfigError(f"--out {arguments.out}: {name} in it is a folder: choose another folder")
    machine = Path(arguments.policy)
    if machine.exists() and machine.resolve() == (arguments.out / MACHINE).resolve():
        raise ConfigError(f"--policy {machine}: the search would write its result over it: choose another --out")


def _tune(arguments: options.TuneArguments, machine: MachineDefinition, origin: str, bar: Bar) -> Tuned:
    from tral_fsm.tuning import tune

    return tune(
        machine,
        arguments.params,
        arguments.task,
        objective=arguments.objective,
        settings=arguments.settings,
        tie=arguments.tie,
        processes=arguments.processes,
        out=arguments.out,
        resume=arguments.resume,
        storage=arguments.storage,
        origin=origin,
        on_progress=bar.best,
        on_stage=bar.stage,
        on_note=bar.note,
    )


def _write_page(arguments: options.TuneArguments, tuned: Tuned, report: dict[str, Any], bar: Bar) -> None:
    from tral_fsm.report.tuning.page import report_html
    from tral_fsm.tuning.examples import examples

    page = examples(
        tuned,
        arguments.task,
        arguments.objective,
        command=report["command"],
        version=report["versions"]["tral-env"],
        processes=arguments.processes,
        size=arguments.grid,
        on_stage=bar.stage,
    )
    write_bytes(arguments.out / PAGE, report_html(page).encode("utf-8"))


def _origin() -> str:
    """The command line as files tell it, without the password of a database."""
    from tral_fsm.tuning.search.storage import masked

    arguments = sys.argv[1:]
    if arguments[:1] != ["tune"]:
        return "tral tune"
    return " ".join(["tral", *(shlex.quote(masked(each)) for each in arguments)])
