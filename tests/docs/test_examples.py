"""Every example of README.md and docs/ runs."""

from __future__ import annotations

import importlib.util
import os
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from pages import PAGES, ROOT, Example, commands, examples, read

BIN = Path(sys.executable).parent

SET_UP = ("python3 -m venv ", ".venv/bin/pip install ", "pip install ", ".venv/bin/pytest", "pytest ")
"""What begins so installs or runs these tests: .ci/run does it, with the command of the README."""

ONE_CANDIDATE = "--seeds 111:112 --budget 1 --report-seeds none --grid 0 --processes 1"
"""A search with one candidate, on short courses: the old and the new machine drive one, and the two of the finals."""
AND_A_CHECK = f"{ONE_CANDIDATE} --report-seeds 65:66"
"""The same, and both drive one more course."""

CHEAPER = {
    ".venv/bin/tral drive --scenario office --seed 7 --camera rendered --out runs/first": (
        "--seed 34 --camera projected --no-video"
    ),
    'tral tune --policy wall --scenario straight --params "*.p,*.d" --budget 600 --out runs/tune': AND_A_CHECK,
    'tral tune --policy wall --scenario straight --params "follow.p,follow.d" --randomization hard --budget 300 '
    "--seeds 0:12 --report-seeds 500:540": ONE_CANDIDATE,
    'tral tune --policy crossing --scenario crossing --tie --params "follow.speed=0.6:1.6,turn *.speed=0.35:0.9,'
    'settle.speed=0.4:1.2" --randomization hard --budget 480 --seeds 200:240 --report-seeds 500:600': AND_A_CHECK,
    "tral tune --policy wall --sampler tpe --storage study.log --out runs/tune1": ONE_CANDIDATE,
    "tral compare --policies office,pursuit,constant,random --suite smoke --out runs/compare": "--courses 1",
    "tral train --algo teacher --scenario corners --minutes 4 --out runs/student": "--minutes 0.01 --validation 1",
    "tral compare --policies specialists,office,residual,student,ppo,ramp,pursuit,constant,random --suite standard "
    "--courses 200 --out runs/published": "--policies constant --suite smoke --courses 1",
    "python benchmarks/compare.py": "--policies constant --suite smoke --courses 1 --videos 0 --processes 1",
    "python benchmarks/marker_accuracy.py --out runs/marker_accuracy.json": "--views 16",
    "python benchmarks/gate_accuracy.py --out runs/gate_accuracy.json": "--views 12",
    "python benchmarks/detector_fit.py": "--views 48",
    "python benchmarks/recorder.py --out runs/recorder.json": "--seconds 0.5 --kills 1 --no-images",
    "tral live --policy office --scenario office --seed 7": "--seconds 1 --port 0",
    "tral live --replay docs/recordings/short.mcap": "--seconds 1 --port 0",
    "tral twin up --scenario corners --seed 3": "--name page-of-tests --bus 906 --seconds 0.5",
}
"""Shell examples that would take too long -> options that come after theirs and win."""

LITERAL = (
    "tral drive --policy wall --course short --no-video --record --out runs/recorded",
    "tral replay docs/recordings/short.mcap",
    "tral replay docs/recordings/short.mcap --against simulation",
    "tral replay docs/recordings/short.mcap --policy corridor",
    "tral replay docs/recordings/short.mcap --video",
    "tral replay docs/recordings/short.mcap --to mcap",
    "tral replay docs/recordings/short.mcap --to csv --to lerobot",
    "python benchmarks/compare.py --agents 3 --hours 10 --dry-run",
    "python benchmarks/compare.py --policies corners,pursuit,constant --suite corners --scenario corners --courses 40 "
    "--agents 2 --algos teacher:5,ppo,residual --hours 1.3333 --no-search --dry-run",
    "python benchmarks/plot_perception.py runs/img",
    "tral tune --list-params --policy office",
    "tral ros bag docs/recordings/short.mcap --out runs/short-ros2.mcap",
    "tral doctor",
    "tral car init car.toml --board pca9685 --sensor srf08 --sensor hall",
    "tral twin fault list",
    "tral courses",
    "tral calibrate --simulated --out runs/calibrate",
    "tral detect docs/img/detect_view.png --lens default --out runs/seen.png",
    "tral print board --out board.pdf",
    "tral print gate 3 --out gate.pdf",
    "tral print marker 40 41 42 --out turns.svg",
    "tral fsm convert office office.uxf",
    "tral fsm convert office office.mmd",
    "tral fsm new mine.uxf",
    "tral fsm check wall gate office",
    "tral fsm convert gate gate.scxml",
    "tral fsm states FollowWall",
    "tral fsm draw office -o office.png",
    "ruff format --check .",
    "ruff check .",
    "mypy",
)
"""Shell examples that run word by word."""

IN_CHECKOUT = ("ruff", "mypy")
"""Programs that look at the checkout; everything else runs in a folder of its own, with links to the checkout."""

FOLLOWED_ELSEWHERE = "docs/tutorial.md"
"""Its examples are files and commands that need one another: test_tutorial_page.py follows it in order."""

SKIPS_WITHOUT = {"lerobot": "pyarrow", "train": "torch", "tpe": "optuna", "bag": "cyclonedds", "live": "viser"}

PAGE_SKIPS_WITHOUT = {
    "docs/learning.md": ("stable_baselines3",),
    "docs/live.md": ("viser",),
    "docs/recording.md": ("pyarrow",),
    "docs/ros.md": ("cyclonedds",),
}

OPTIONAL = ("skrl",)
"""Packages of no extra: a block that imports one is left out where it is missing; the rest of its page runs."""

SHELL = {
    command: example
    for page in PAGES
    for example in examples(page, read(page))
    if example.language in ("bash", "sh", "console")
    for command in commands(example)
    if not command.startswith(SET_UP) and page != FOLLOWED_ELSEWHERE
}
"""Command -> an example that shows it; what several pages show runs once."""

PYTHON = {
    page: blocks
    for page in PAGES
    if (blocks := [example for example in examples(page, read(page)) if example.language == "python"])
    and page != FOLLOWED_ELSEWHERE
}
"""Page -> its Python examples."""


def run_python(blocks: list[Example], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the blocks of a page one after the other, as one program whose tracebacks name lines of the page."""
    code = "names = {'__name__': '__main__'}\n" + "\n".join(
        f"exec(compile({chr(10) * block.line + block.text!r}, {block.page!r}, 'exec'), names)" for block in blocks
    )
    return subprocess.run([sys.executable, "-W", "error", "-c", code], cwd=folder, capture_output=True, text=True)


@pytest.mark.parametrize("page", PYTHON)
def test_python_examples_run_in_order(page: str, tmp_path: Path) -> None:
    for package in PAGE_SKIPS_WITHOUT.get(page, ()):
        pytest.importorskip(package, exc_type=ImportError)
    missing = [package for package in OPTIONAL if importlib.util.find_spec(package) is None]
    blocks = [block for block in PYTHON[page] if not any(f"from {package}" in block.text for package in missing)]
    done = run_python(blocks, tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(("command", "example"), SHELL.items(), ids=list(SHELL))
def test_shell_examples_run(command: str, example: Example, tmp_path: Path) -> None:
    assert command in CHEAPER or command in LITERAL, (
        f"{example.page}: no test runs `{command}`: name it in LITERAL, or in CHEAPER with options that make it quick"
    )
    program, *arguments = shlex.split(command + " " + CHEAPER.get(command, ""))
    for argument in arguments:
        pytest.importorskip(SKIPS_WITHOUT.get(argument, "sys"), exc_type=ImportError)
    for folder in ("benchmarks", "docs"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    done = subprocess.run(
        [BIN / Path(program).name, *arguments],
        cwd=ROOT if program in IN_CHECKOUT else tmp_path,
        env=os.environ | {"COLUMNS": "120"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_no_command_is_listed_that_no_page_shows() -> None:
    assert {*CHEAPER, *LITERAL} <= SHELL.keys()


def test_other_blocks_are_no_forgotten_programs() -> None:
    languages = {example.language for page in PAGES for example in examples(page, read(page))}
    assert languages <= {"python", "bash", "json", "toml", ""}
    for page in PAGES:
        for example in examples(page, read(page)):
            if example.language == "toml":
                tomllib.loads(example.text)


def test_the_command_of_ci_is_the_one_of_the_readme() -> None:
    (block,) = [
        example for example in examples("README.md", read("README.md")) if "<!-- tests -->" in line_above(example)
    ]
    assert commands(block)[-1].startswith(".venv/bin/pytest")


def line_above(example: Example) -> str:
    return read(example.page).splitlines()[example.line - 2]
