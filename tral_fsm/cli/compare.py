"""`tral compare`: policies of any kind drive the same courses; the result is a page with intervals."""

from __future__ import annotations

import json
import shlex
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tral_env.atomic import write_bytes
from tral_env.perception import opengl
from tral_fsm.cli.terminal import drives_bar, narrow_table, print_figures
from tral_fsm.evaluation.files import prepare_folder, write_json

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from tral_fsm.evaluation.contenders import Contender
    from tral_fsm.evaluation.suites import Suite

FIGURES, TABLES, PAGE = "compare.json", "compare.md", "compare.html"
"""Files that the command writes beside the records."""


def command(
    policies: Annotated[
        str,
        typer.Option(
            help="Contenders, separated by commas: packaged machines, machine files, policy files, FILE.py:NAME, or "
            "the built-in constant, random, pursuit and ramp. NAME=A+B makes one contender of agents that were trained "
            "with different seeds."
        ),
    ] = "office,pursuit,constant,random",
    suite: Annotated[str, typer.Option(help="Courses: smoke or standard.")] = "smoke",
    courses: Annotated[
        int | None, typer.Option(min=1, help="Courses of each family and level, if not those of the suite.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the bootstrap; it changes no drive.")] = 0,
    processes: Annotated[int, typer.Option(min=1, help="Processes that drive.")] = 1,
    videos: Annotated[
        int, typer.Option(min=0, help="Short videos of so many failures on the page, which need OpenGL.")
    ] = 0,
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the files; a comparison that lies there goes on.")
    ] = Path("runs/compare"),
    as_json: Annotated[bool, typer.Option("--json", help="Print compare.json and nothing else.")] = False,
) -> None:
    """Compare policies on a suite of courses.

    The command writes compare.html, compare.md and compare.json, and each drive into records.jsonl as it ends. Started
    again, it goes on where it stopped. Other policies or more courses can be added later.
    """
    shown = run(policies, suite, out, courses=courses, seed=seed, processes=processes, videos=videos)
    if as_json:
        typer.echo(json.dumps(without_paths(shown), indent=2, allow_nan=False))
        return
    print_figures(table(shown))
    typer.echo(f"Page: {out / PAGE}")


def run(policies: str, suite: str, out: Path, *, courses: int | None = None, **options: int) -> dict[str, Any]:
    """Drive, analyse, and write all files.

    Args:
        policies: the contenders, see `evaluation.contenders.contenders`.
        suite: name of the suite.
        out: folder of the files.
        courses: number of courses of each task; None: that of the suite.
        options: see `compare`.

    Returns:
        The content of compare.json.

    Raises:
        TralError: a policy cannot be loaded or fails, the suite is unknown, or the folder holds another comparison.
    """
    from tral_fsm.evaluation import suites
    from tral_fsm.evaluation.contenders import contenders

    opengl.require_loadable()
    chosen = suites.suite(suite).with_courses(courses)
    return compare(chosen, contenders(policies), out, **options)


def compare(
    suite: Suite, field: Sequence[Contender], out: Path, *, seed: int = 0, processes: int = 1, videos: int = 0
) -> dict[str, Any]:
    """As `run`, for a suite and contenders that were made already.

    Args:
        suite: the courses.
        field: the contenders.
        out: folder of the files.
        seed: seed of the bootstrap.
        processes: number of processes that drive.
        videos: number of failures of which the page has a video.
    """
    from tral_fsm.evaluation.analysis import analyse
    from tral_fsm.evaluation.comparison import drive_missing, plans_of
    from tral_fsm.report.compare.markdown import markdown
    from tral_fsm.report.compare.page import page_html

    began = time.perf_counter()
    prepare_folder(out)
    lines = drive_missing(suite, field, out, processes, drives_bar)
    shown = analyse(lines, suite, [one.record() for one in field], seed)
    program = Path(sys.argv[0]).name
    shown |= {"command": shlex.join([program, *sys.argv[1:]]), "seconds": round(time.perf_counter() - began, 1)}
    write_json(out / FIGURES, without_paths(shown))
    write_bytes(out / TABLES, markdown(shown).encode())
    write_bytes(out / PAGE, page_html(shown, plans_of(shown), clips(shown, suite, field, videos)).encode())
    return shown


def clips(shown: dict[str, Any], suite: Suite, field: Sequence[Contender], videos: int) -> dict[int, bytes]:
    """Videos of the first failures that can be driven again: number of the failure -> mp4 file."""
    from tral_fsm.evaluation.comparison import drive_again
    from tral_fsm.evaluation.contenders import single_policy
    from tral_fsm.report.compare.clip import Clip

    agents = {(one.name, agent.source): agent for one in field for agent in one.agents}
    made: dict[int, bytes] = {}
    for number, failure in enumerate(shown["failures"]):
        if len(made) == videos:
            break
        policy = single_policy(agents[failure["contender"], failure["agent"]])
        if policy is None:
            continue
        taken: list[Clip] = []

        def watch(env: Any, failure: dict[str, Any] = failure, taken: list[Clip] = taken) -> Clip:
            taken.append(Clip(env, failure["time_s"]))
            return taken[0]

        episode = drive_again(failure, suite, policy, watch)
        if episode.outcome == failure["outcome"]:
            with tempfile.TemporaryDirectory() as folder:
                taken[0].write(Path(folder) / "clip.mp4")
                made[number] = (Path(folder) / "clip.mp4").read_bytes()
    return made


def without_paths(shown: dict[str, Any]) -> dict[str, Any]:
    """The content without the paths, which are in the records."""
    cut = [{name: value for name, value in one.items() if name != "path"} for one in shown["failures"]]
    return {name: value for name, value in shown.items() if name != "paths"} | {"failures": cut}


def table(shown: dict[str, Any]) -> Table:
    """The main figures of each contender."""
    suite = shown["suite"]
    table = narrow_table(f"{suite['name']}, seeds {suite['seeds'][0]} to {suite['seeds'][1] - 1} ({suite['split']})")
    table.add_column("contender", no_wrap=True)
    for heading in ("drives", "success", "95 %", "score", "IQM", "95 %", "progress", "m/s"):
        table.add_column(heading, justify="right", no_wrap=True)
    for one in shown["contenders"]:
        got = one["figures"]
        success, iqm = got["success"], got["iqm"]
        table.add_row(
            one["name"],
            str(got["drives"]),
            f"{100 * success['value']:.1f} %",
            f"{100 * success['low']:.0f} to {100 * success['high']:.0f} %",
            f"{got['score']['value']:.3f}",
            f"{iqm['value']:.3f}",
            f"{iqm['low']:.3f} to {iqm['high']:.3f}",
            f"{100 * got['progress']['value']:.0f} %",
            f"{got['pace_mps']:.2f}",
        )
    return table
