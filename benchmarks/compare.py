"""Remake the published comparison: nothing but calls of `tral tune`, `tral train` and `tral compare`.

    python benchmarks/compare.py --out runs/published

drives all contenders that need no preparing over the standard suite. With --agents 3 it first prepares others from
nothing, each with the same budget of simulated driving: a search for the speeds of the machine `office`, and trainings
with three seeds for each algorithm. The algorithm teacher_ppo spends half of the budget on a student, and the other
half on the PPO that goes on from it; teacher:5 stands for five seeds. It prints each command before it runs, and
--dry-run prints them alone. Started again, it goes on where it stopped.
"""

from __future__ import annotations

import json
import math
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import typer

from tral_env import yaml_text
from tral_env.checks import one_of
from tral_env.errors import ConfigError, TralError
from tral_fsm.evaluation.choices import listed
from tral_fsm.learning.choices import ALGORITHMS, settings_text

Command = list[str]

READY = "specialists,office,residual,student,ppo,ramp,pursuit,constant,random"
"""Contenders that need no preparing."""
SPEEDS = "follow.speed=0.6:1.6,pass *.speed=0.3:0.9,turn *.speed=0.35:0.9"
"""What the search changes of `office`."""
DRIVE_S = 25.0
"""A drive of the search takes about so long, simulated, s: it turns hours into drives. The page tells the true time."""


STUDENT_FIRST = "teacher_ppo"
"""Half of the budget teaches a student, and PPO goes on from it with the other half."""


def tuning(hours: float, out: Path, scenario: str) -> list[Command]:
    """The search, if its machine is not there."""
    if (out / "tuned" / "tune.json").exists():
        return []
    budget = max(round(hours * 3600.0 / DRIVE_S), 1)
    resume = ["--resume"] if (out / "tuned" / "study.jsonl").exists() else []
    what = ["--policy", "office", "--scenario", scenario, "--tie", "--params", SPEEDS]
    courses = ["--randomization", "hard", "--seeds", "200:204", "--report-seeds", "500:505"]
    return [["tral", "tune", *what, *courses, "--budget", str(budget), "--out", str(out / "tuned"), *resume]]


def trainings(algo: str, seed: int, hours: float, out: Path, scenario: str) -> list[Command]:
    """What makes an agent, but for the trainings that have had all of their steps."""
    if algo != STUDENT_FIRST:
        return training(algo, decision_hz(algo), ["--seed", str(seed)], hours, out / f"{algo}{seed}", scenario)
    begun, rate, seeded = out / f"start{seed}", decision_hz("teacher"), ["--seed", str(seed)]
    student = training("teacher", rate, [*seeded, "--plain"], hours / 2, begun, scenario)
    goes_on = [*seeded, "--from", str(begun)]
    return [*student, *training("ppo", rate, goes_on, hours / 2, out / f"{algo}{seed}", scenario)]


def training(
    algo: str, rate: float, options: Sequence[str], hours: float, folder: Path, scenario: str
) -> list[Command]:
    """One training, unless it has had all of its steps; `rate` is in decisions a second."""
    steps, curve = math.ceil(hours * 3600.0 * rate), folder / "curve.json"
    if curve.exists() and json.loads(curve.read_text(encoding="utf-8"))[-1]["steps"] >= steps:
        return []
    resume = ["--resume"] if (folder / "checkpoint.pt").exists() else []
    what = ["--algo", algo, "--scenario", scenario, *options, "--steps", str(steps)]
    return [["tral", "train", *what, "--out", str(folder), *resume]]


def decision_hz(algo: str) -> float:
    """How often a network of an algorithm decides, by the file of its hyper-parameters.

    Raises:
        ConfigError: there is no such algorithm.
    """
    one_of("algorithm", algo, ALGORITHMS)
    (settings,) = yaml_text.documents(settings_text(algo), algo, ConfigError)
    return float(settings["learner"]["decision_hz"])


def comparison(policies: str, suite: str, courses: int | None, processes: int, videos: int, out: Path) -> Command:
    """The comparison."""
    number = [] if courses is None else ["--courses", str(courses)]
    options = ["--suite", suite, *number, "--processes", str(processes), "--videos", str(videos)]
    return ["tral", "compare", "--policies", policies, *options, "--out", str(out)]


def counted(algos: Sequence[str], agents: int) -> dict[str, int]:
    """Number of agents by algorithm, from names such as ppo and teacher:5.

    Raises:
        ConfigError: an algorithm is unknown, or a number is none.
    """
    found = {}
    for entry in algos:
        algo, _, number = entry.partition(":")
        one_of("algorithm", algo, (*ALGORITHMS, STUDENT_FIRST))
        if number and not (number.isdecimal() and int(number)):
            raise ConfigError(f"--algos {entry}: expected a number of agents behind the colon, such as {algo}:5")
        found[algo] = int(number) if number else agents
    return found


def prepared(agents: Mapping[str, int], out: Path) -> list[str]:
    """Entries of --policies for what the trainings leave."""
    learners = {algo: "+".join(str(out / f"{algo}{seed}") for seed in range(n)) for algo, n in agents.items()}
    return [f"{algo}={one}" for algo, one in learners.items()]


def plan(
    policies: str, algos: Sequence[str], agents: int, hours: float, out: Path, suite: str, courses: int | None,
    processes: int, videos: int, scenario: str = "all", search: bool = True,
) -> list[Command]:  # fmt: skip
    """All commands, in their order."""
    commands: list[Command] = []
    field = [policies]
    if agents:
        numbers = counted(algos, agents)
        if search:
            commands += tuning(hours, out, scenario)
            field.append(f"tuned={out / 'tuned' / 'machine.json'}")
        each = [(algo, seed) for algo, number in numbers.items() for seed in range(number)]
        commands += [one for algo, seed in each for one in trainings(algo, seed, hours, out, scenario)]
        field += prepared(numbers, out)
    return [*commands, comparison(",".join(field), suite, courses, processes, videos, out)]


def run(command: Command) -> None:
    """Run a command; Ctrl-C waits until it has kept what it has.

    Raises:
        SystemExit: it failed, or Ctrl-C stopped it.
    """
    program = Path(sys.executable).with_name(command[0])
    with subprocess.Popen([str(program) if program.exists() else command[0], *command[1:]]) as running:
        try:
            code = running.wait()
        except KeyboardInterrupt:
            running.wait()
            code = 1
    if code:
        raise SystemExit(code)


def main(
    policies: Annotated[str, typer.Option(help="Contenders that need no preparing.")] = READY,
    suite: Annotated[str, typer.Option(help="Courses: smoke, corners or standard.")] = "standard",
    courses: Annotated[int | None, typer.Option(min=1, help="Courses of each family and level.")] = None,
    agents: Annotated[int, typer.Option(min=0, help="Trainings of each algorithm; 0: no search, no training.")] = 0,
    algos: Annotated[str, typer.Option(help="Algorithms that are trained, separated by commas.")] = "teacher,ppo",
    hours: Annotated[
        float, typer.Option(min=0.001, help="Simulated driving for the search and each training, h.")
    ] = 10.0,
    scenario: Annotated[str, typer.Option(help="Families of the search and the trainings.")] = "all",
    search: Annotated[bool, typer.Option(help="Search for a machine, too.")] = True,
    processes: Annotated[int, typer.Option(min=1, help="Processes that drive.")] = 2,
    videos: Annotated[int, typer.Option(min=0, help="Videos of failures on the page.")] = 6,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the commands and run none.")] = False,
    out: Annotated[Path, typer.Option(file_okay=False, help="Folder of all files.")] = Path("runs/published"),
) -> None:
    """Prepare, drive and write the page."""
    try:
        commands = plan(
            policies, listed(algos), agents, hours, out, suite, courses, processes, videos, scenario, search
        )
    except TralError as error:
        raise SystemExit(f"Error: {error}") from None
    for command in commands:
        print(shlex.join(command), flush=True)
        if not dry_run:
            run(command)


if __name__ == "__main__":
    typer.run(main)
