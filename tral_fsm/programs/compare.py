"""A comparison of policies: records of the drives, compare.json, compare.md and compare.html are kept in a folder.

Heavy modules are imported when the program runs, because `tral --help` imports its names.
"""

from __future__ import annotations

import os
import shlex
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tral_env.atomic import write_bytes
from tral_env.perception import opengl
from tral_fsm.evaluation.files import prepare_folder, write_json
from tral_fsm.terminal import drives_bar

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tral_fsm.evaluation.cluster import Workers
    from tral_fsm.evaluation.contenders import Contender
    from tral_fsm.evaluation.suites import Suite

FIGURES, TABLES, PAGE = "compare.json", "compare.md", "compare.html"
"""Files that the program writes beside the records."""
UNWRITABLE = "backslashreplace"
"""What becomes of halves of characters in names of files and in what policies tell."""


def run(policies: str, suite: str, out: Path, *, courses: int | None = None, **options: Any) -> dict[str, Any]:
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
    suite: Suite, field: Sequence[Contender], out: Path, *, seed: int = 0, processes: Workers = 1, videos: int = 0
) -> dict[str, Any]:
    """As `run`, for a suite and contenders that were made already.

    Args:
        suite: the courses.
        field: the contenders.
        out: folder of the files.
        seed: seed of the bootstrap.
        processes: number of processes that drive, or address of a Dask scheduler.
        videos: number of failures of which the page has a video.
    """
    from tral_fsm.evaluation.analysis import analyse
    from tral_fsm.evaluation.comparison import drive_field, plans_of
    from tral_fsm.report.compare.markdown import markdown
    from tral_fsm.report.compare.page import page_html

    began, began_cpu_s = time.perf_counter(), _cpu_s()
    prepare_folder(out)
    lines = drive_field(suite, field, out, processes, drives_bar)
    shown = analyse(lines, suite, [one.record() for one in field], seed)
    program = Path(sys.argv[0]).name
    shown |= {
        "command": shlex.join([program, *sys.argv[1:]]),
        "seconds": round(time.perf_counter() - began, 1),
        "cpu_seconds": round(_cpu_s() - began_cpu_s, 1),
    }
    write_json(out / FIGURES, without_paths(shown))
    write_bytes(out / TABLES, markdown(shown).encode(errors=UNWRITABLE))
    plans = plans_of(shown)
    write_bytes(out / PAGE, page_html(shown, plans).encode(errors=UNWRITABLE))
    if videos:  # the page stands, even if this computer cannot render
        write_bytes(out / PAGE, page_html(shown, plans, clips(shown, suite, field, videos)).encode(errors=UNWRITABLE))
    return shown


def _cpu_s() -> float:
    """Time that the cores spent on this process and on those that it started and that have ended, s."""
    return sum(os.times()[:4])


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
        policy = single_policy(agents[failure["contender"], failure["agent"]], failure["scenario"])
        if policy is None:
            continue
        taken: list[Clip] = []

        def watch(env: Any, failure: dict[str, Any] = failure, taken: list[Clip] = taken) -> Clip:
            taken.append(Clip(env, failure["time_s"]))
            return taken[0]

        episode = drive_again(failure, suite, policy, watch)
        # A network's answers differ in the last bit from batch to batch, so its drive may end otherwise or earlier.
        if episode.outcome == failure["outcome"] and taken[0].has_pictures:
            with tempfile.TemporaryDirectory() as folder:
                taken[0].write(Path(folder) / "clip.mp4")
                made[number] = (Path(folder) / "clip.mp4").read_bytes()
    return made


def without_paths(shown: dict[str, Any]) -> dict[str, Any]:
    """The content without the paths, which are in the records."""
    cut = [{name: value for name, value in one.items() if name != "path"} for one in shown["failures"]]
    return {name: value for name, value in shown.items() if name != "paths"} | {"failures": cut}
