"""How often does a policy arrive? Seeds x families, with 95 % intervals.

    python benchmarks/report.py --seeds 1000:1050 --scenarios all --policy office --camera rendered \
        --out benchmarks/results/office.jsonl

Each episode is appended to the file as it ends; run it again and it goes on where it was stopped.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import multiprocessing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import Progress

from tral_env.course.generate import SCENARIOS
from tral_env.errors import ConfigError, TralError
from tral_fsm import load_policy
from tral_fsm.bench.host import host
from tral_fsm.cli.console import check_name
from tral_fsm.cli.drive import Camera, Randomization
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.summary import Summary, summarize
from tral_fsm.formats import write


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What every episode of a file has in common."""

    policy: str
    camera: str
    randomization: str


def main(
    seeds: Annotated[str, typer.Option(help="FIRST:BEHIND, as a range.")] = "1000:1050",
    scenarios: Annotated[str, typer.Option(help="Names with commas between them, or all.")] = "all",
    policy: str = "office",
    camera: Camera = "rendered",
    randomization: Randomization = "default",
    processes: int = 2,
    out: Path = Path("benchmarks/results/office.jsonl"),
    table_only: Annotated[bool, typer.Option(help="Drive nothing, print the table of the file.")] = False,
) -> None:
    """Drive seeds x families and print a table."""
    settings = Settings(policy=policy, camera=camera, randomization=randomization)
    try:
        done = read(out, settings)
        jobs = [(name, seed) for name in families(scenarios) for seed in span(seeds)]
        missing = [] if table_only else [job for job in jobs if job not in done]
        if missing:
            load_policy(policy)  # what cannot drive begins no file
            append(out, {"kind": "run", "settings": asdict(settings), "host": host()})
            work(episode, [(*job, settings) for job in missing], len(missing), processes, out)
        print(markdown(out, settings))
    except TralError as error:
        raise SystemExit(f"Error: {error}") from None


def families(names: str) -> list[str]:
    """Families by name; "all" for all."""
    chosen = list(SCENARIOS) if names == "all" else names.split(",")
    for name in chosen:
        check_name("scenario", name, SCENARIOS)
    return chosen


def span(text: str) -> range:
    """Seeds FIRST:BEHIND."""
    first, _, behind = text.partition(":")
    if not (first.isdigit() and behind.isdigit() and int(first) < int(behind)):
        raise ConfigError(f"--seeds {text}: expected FIRST:BEHIND, such as 1000:1050")
    return range(int(first), int(behind))


def lines(path: Path) -> Iterator[dict[str, Any]]:
    """Lines of a result file; one that was cut off in writing is left out."""
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            with contextlib.suppress(json.JSONDecodeError):
                yield json.loads(line)


def digest(machine: MachineDefinition) -> str:
    """Tells machines apart, whatever they are called."""
    return hashlib.sha256(write(machine, "json").encode()).hexdigest()[:16]


def made_with(path: Path, settings: Any, machines: Mapping[str, str] | None = None) -> list[dict[str, Any]]:
    """Lines of a result file, which may not be there yet.

    Args:
        path: the file.
        settings: those of the run that goes on with it.
        machines: digests of the machines that drive, by name.

    Raises:
        ConfigError: it was made with other settings or other machines.
    """
    found = list(lines(path))
    for line in found:
        if line["kind"] == "run" and line["settings"] != asdict(settings):
            raise ConfigError(f"{path} was made with {line['settings']}, not {asdict(settings)}: choose another --out")
        changed = [name for name, was in line.get("machines", {}).items() if was != (machines or {}).get(name)]
        if changed:
            raise ConfigError(f"{path}: {', '.join(changed)} changed since it was made: choose another --out")
    return found


def read(path: Path, settings: Settings) -> dict[tuple[str, int], dict[str, Any]]:
    """Episodes that a file holds, by family and seed.

    Raises:
        ConfigError: it was made with other settings.
    """
    return {(line["scenario"], line["seed"]): line for line in made_with(path, settings) if line["kind"] == "episode"}


def append(path: Path, line: dict[str, Any]) -> None:
    """Write a line at once, below whatever was cut off there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+", encoding="utf-8") as file:
        file.seek(0)
        whole = file.read()[-1:] in ("", "\n")
        file.write(("" if whole else "\n") + json.dumps(line) + "\n")


def work(
    drive: Callable[..., list[dict[str, Any]]], calls: Sequence[tuple[Any, ...]], total: int, processes: int, out: Path
) -> None:
    """Let processes drive, and append the lines that each call gives as they come.

    Args:
        drive: gives the lines of some drives.
        calls: its arguments, call by call.
        total: how many lines there will be.
        processes: how many work at once.
        out: the file.
    """
    # Threads and OpenGL contexts do not survive a fork.
    context = multiprocessing.get_context("spawn")
    with Progress(console=Console(stderr=True)) as bar, ProcessPoolExecutor(processes, context) as pool:
        task = bar.add_task("drives", total=total)
        futures: list[Future[list[dict[str, Any]]]] = [pool.submit(drive, *call) for call in calls]
        try:
            for future in as_completed(futures):
                for line in future.result():
                    append(out, line)
                    bar.advance(task)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


_kept: dict[tuple[str, Settings], tuple[Any, Any]] = {}


def episode(scenario: str, seed: int, settings: Settings) -> list[dict[str, Any]]:
    """The line of one episode, driven in a process that keeps its last env."""
    from tral_fsm.evaluation.rollout import drive

    key = (scenario, settings)
    if key not in _kept:
        for env, _ in _kept.values():
            env.close()
        _kept.clear()
        _kept[key] = _make(scenario, settings)
    env, policy = _kept[key]
    return [{"kind": "episode", **drive(env, policy, seed, scenario=scenario).record()}]


def _make(scenario: str, settings: Settings) -> tuple[Any, Any]:
    import gymnasium as gym

    env = gym.make(
        "tral_env:TralCorridor-v0",
        scenario=scenario,
        camera=settings.camera,
        randomization=settings.randomization,
    )
    return env, load_policy(settings.policy)


def markdown(path: Path, settings: Settings) -> str:
    """The file as a Markdown table."""
    episodes = read(path, settings)
    runs = [line["host"] for line in lines(path) if line["kind"] == "run"]
    commits = sorted({str(run["commit"]) for run in runs})
    heading = [
        f"policy {settings.policy}, camera {settings.camera}, randomization {settings.randomization}",
        f"seeds {stretches({seed for _, seed in episodes})}" if episodes else "no episodes",
        *(f"{run['cpu']}, {run['cores']} cores, {run['versions']}" for run in runs[-1:]),
        f"commits {', '.join(commits)}",
    ]
    rows = [
        "| family | episodes | success | 95 % | collisions (crashes) | missed gates | timeouts | progress "
        "| clearance RMSE | gates | mean speed |",
        "| --- " + "| ---: " * 10 + "|",
    ]
    for name in SCENARIOS:
        records = [record for (family, _), record in episodes.items() if family == name]
        if records:
            rows.append(row(name, summarize(records)))
    rows.append(row("all", summarize(episodes.values())))
    return "\n".join([*heading, "", *rows])


def stretches(seeds: Iterable[int]) -> str:
    """Numbers in words: "0 to 9, 1000 to 1049"."""
    ends: list[list[int]] = []
    for seed in sorted(seeds):
        if ends and seed == ends[-1][1] + 1:
            ends[-1][1] = seed
        else:
            ends.append([seed, seed])
    return ", ".join(str(first) if first == last else f"{first} to {last}" for first, last in ends)


def row(name: str, figures: Summary) -> str:
    """One line of the table."""
    rmse = "-" if figures.clearance_rmse_m is None else f"{100 * figures.clearance_rmse_m:.1f} cm"
    cells = [
        name,
        figures.episodes,
        f"{100 * figures.success_rate:.0f} %",
        f"{100 * figures.success_low:.0f} to {100 * figures.success_high:.0f} %",
        f"{figures.collisions} ({figures.crashes})",
        figures.missed_gates,
        figures.timeouts,
        f"{100 * figures.progress:.0f} %",
        rmse,
        f"{figures.gates_passed}/{figures.gates_total}" if figures.gates_total else "-",
        f"{figures.mean_speed_mps:.2f} m/s",
    ]
    return f"| {' | '.join(str(cell) for cell in cells)} |"


if __name__ == "__main__":
    typer.run(main)
