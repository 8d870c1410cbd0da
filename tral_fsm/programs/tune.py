"""A search for parameters of a machine, with its check; the machine, its numbers and a page are kept in a folder.

Heavy modules are imported when the program runs, because `tral --help` imports its arguments.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from tral_env.atomic import write_bytes
from tral_env.errors import ConfigError
from tral_env.perception import opengl
from tral_env.recording.about import versions
from tral_fsm.evaluation.cluster import Workers
from tral_fsm.evaluation.files import prepare_folder, write_json
from tral_fsm.evaluation.folder import held
from tral_fsm.tuning.folder import MACHINE, NUMBERS, PAGE, RESULTS, STUDY

if TYPE_CHECKING:
    from tral_fsm.definition.machine import MachineDefinition
    from tral_fsm.tuning import Objective, Progress, Settings, Stage, Task, Tuned


@dataclass(frozen=True, kw_only=True)
class TuneArguments:
    """What is tuned, how, and where the results go."""

    policy: str
    """Name or path of the machine."""
    params: list[str]
    """Patterns of the parameters."""
    tie: bool
    """Whether all parameters of a pattern have one value."""
    task: Task
    objective: Objective
    settings: Settings
    processes: Workers
    """Number of processes, or address of a Dask scheduler."""
    storage: str | None
    """Database or journal file that commands share."""
    out: Path
    """Folder of the results."""
    resume: bool
    """Whether the study in the folder goes on."""
    save_as: Path | None
    """File of the machine beside that in the folder."""
    grid: int
    """Points along a side of the plot of cost; 0: no plot."""
    origin: str
    """The command line, as files tell it."""


class Watcher(Protocol):
    """Shows a search while it runs."""

    def best(self, progress: Progress) -> None:
        """Show the best candidate."""

    def stage(self, stage: Stage) -> None:
        """Show the progress of a stage."""

    def note(self, said: str) -> None:
        """Tell something that the user should know."""


def check(arguments: TuneArguments, machine: MachineDefinition) -> None:
    """Refuse arguments that cannot be used, before an hour of driving; make the folder of the results.

    Raises:
        ConfigError: an argument cannot be used; nothing is written then.
    """
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
    prepare_folder(arguments.out)


def _check_files(arguments: TuneArguments) -> None:
    """Refuse a folder where a result cannot be written, or would replace the machine that is tuned."""
    for name in (*RESULTS, STUDY):
        if (arguments.out / name).is_dir():
            raise ConfigError(f"--out {arguments.out}: {name} in it is a folder: choose another folder")
    machine = Path(arguments.policy)
    if machine.exists() and machine.resolve() == (arguments.out / MACHINE).resolve():
        raise ConfigError(f"--policy {machine}: the search would write its result over it: choose another --out")


def run(arguments: TuneArguments, machine: MachineDefinition, watcher: Watcher) -> tuple[Tuned, dict[str, Any]]:
    """Search, check the result on new courses, and write all files; no other search writes into the folder meanwhile.

    Args:
        arguments: what is tuned, checked by `check`.
        machine: the machine that is tuned.
        watcher: shows the search while it runs.

    Returns:
        The result, and the content of tune.json.
    """
    from tral_fsm.evaluation.effort import SUFFIX, of_file
    from tral_fsm.tuning import save

    with held(arguments.out):
        tuned = _tune(arguments, machine, watcher)
        asked = {
            "policy": arguments.policy,
            "task": arguments.task.record(),
            "settings": json.loads(json.dumps(asdict(arguments.settings))),
        }
        joined = {"resumed": arguments.resume or arguments.storage is not None}
        report = {"command": arguments.origin, **asked, "versions": versions(), **joined, **tuned.record()}
        write_json(arguments.out / NUMBERS, report)
        if arguments.save_as is not None:
            save(tuned, arguments.save_as, arguments.origin)
            effort = of_file(arguments.out / MACHINE).record()
            write_json(arguments.save_as.with_suffix(SUFFIX), {name: one for name, one in effort.items() if one})
        _write_page(arguments, tuned, report, watcher)
    return tuned, report


def _tune(arguments: TuneArguments, machine: MachineDefinition, watcher: Watcher) -> Tuned:
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
        is_held=True,
        resume=arguments.resume,
        storage=arguments.storage,
        origin=arguments.origin,
        on_progress=watcher.best,
        on_stage=watcher.stage,
        on_note=watcher.note,
    )


def _write_page(arguments: TuneArguments, tuned: Tuned, report: dict[str, Any], watcher: Watcher) -> None:
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
        on_stage=watcher.stage,
    )
    write_bytes(arguments.out / PAGE, report_html(page).encode("utf-8"))
