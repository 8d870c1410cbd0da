"""`tral tune`: a search for parameters of a machine, with a check on courses that the search has not seen."""

from __future__ import annotations

import contextlib
import json
import os
import shlex
import sys
from typing import TYPE_CHECKING

import typer

from tral_fsm.cli import tune_options as options
from tral_fsm.cli.console import refuse_both
from tral_fsm.cli.together import taking
from tral_fsm.cli.tune_show import Bar, kept_text, print_result, show_parameters
from tral_fsm.evaluation.choices import listed
from tral_fsm.programs.tune import TuneArguments, check, run

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tral_fsm.definition.machine import MachineDefinition


@taking(options.TuneOptions)
def command(context: typer.Context, given: options.TuneOptions) -> None:
    """Search parameters of a machine, and check the result on courses that the search has not seen.

    The command writes machine.json, tune.json, report.html and study.jsonl into the folder. Ctrl-C keeps the results
    so far; --resume goes on.
    """
    from tral_fsm.cli.tune_classical import show_classical
    from tral_fsm.formats.library import load as load_machine

    refuse_both(context, "scenario", "course")
    refuse_both(context, "processes", "cluster")
    machine = load_machine(given.policy)
    if given.classical:
        show_classical(machine, as_json=given.as_json)
        return
    if given.list_params:
        show_parameters(machine, as_json=given.as_json)
        return
    arguments = _arguments(given, machine)
    check(arguments, machine)
    with _shown(arguments) as bar:
        tuned, report = run(arguments, machine, bar)
    if given.as_json:
        typer.echo(json.dumps(report, indent=2))
    else:
        print_result(tuned, given.out)


def _arguments(given: options.TuneOptions, machine: MachineDefinition) -> TuneArguments:
    """What the program `tune` is to do."""
    from tral_fsm.tuning import Objective

    return TuneArguments(
        policy=given.policy,
        params=_chosen(machine, given.params),
        tie=given.tie,
        task=options.task_of(given),
        objective=Objective(pooling=given.objective),
        settings=options.settings_of(given),
        processes=given.cluster or given.processes or os.cpu_count() or 1,
        storage=given.storage,
        out=given.out,
        resume=given.resume,
        save_as=given.save_as,
        grid=given.grid,
        origin=_origin(),
    )


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
