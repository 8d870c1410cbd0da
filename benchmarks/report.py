"""How often does a policy arrive? Seeds x families, with 95 % intervals.

    python benchmarks/report.py --seeds 1000:1050 --scenarios all --policy office --camera rendered \
        --out benchmarks/results/office.jsonl

The script appends each episode to the file as it ends; started again, it goes on where it stopped.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from run_settings import ClusterAddress, RunSettings

from tral_env.course.generate import SCENARIOS
from tral_env.errors import TralError
from tral_fsm import load_policy
from tral_fsm.evaluation.choices import Camera, Randomization, families
from tral_fsm.evaluation.pool import stop_check
from tral_fsm.evaluation.records import drive_missing, made_with, read_lines
from tral_fsm.evaluation.seeds import parse_seeds, stretches
from tral_fsm.evaluation.summary import Summary, summarize
from tral_fsm.terminal import drives_bar


def main(
    seeds: Annotated[str, typer.Option(help="Seeds FIRST:END.")] = "1000:1050",
    scenarios: Annotated[str, typer.Option(help="Families, separated by commas, or all.")] = "all",
    policy: str = "office",
    camera: Camera = "rendered",
    randomization: Randomization = "default",
    processes: Annotated[int, typer.Option(min=1)] = 2,
    cluster: ClusterAddress = None,
    out: Path = Path("benchmarks/results/office.jsonl"),
    table_only: Annotated[bool, typer.Option(help="Print the table of the file, and drive nothing.")] = False,
) -> None:
    """Drive seeds x families and print a table."""
    settings = RunSettings(policy=policy, camera=camera, randomization=randomization)
    try:
        if not table_only:
            load_policy(policy)  # a policy that cannot drive begins no file
            drive_missing(
                {name: parse_seeds(seeds) for name in families(scenarios)},
                episodes,
                lambda line: (line["scenario"], line["seed"]),
                out=out,
                settings=settings,
                chunk=1,
                processes=cluster or processes,
                bar=drives_bar,
            )
        print(markdown(out, settings))
    except TralError as error:
        raise SystemExit(f"Error: {error}") from None


def read(path: Path, settings: RunSettings) -> dict[tuple[str, int], dict[str, Any]]:
    """Episodes that a file holds, by family and seed.

    Raises:
        ConfigError: it was made with other settings.
    """
    return {(line["scenario"], line["seed"]): line for line in made_with(path, settings) if line["kind"] == "episode"}


_kept: dict[tuple[str, RunSettings], tuple[Any, Any]] = {}


def episodes(scenario: str, seeds: Sequence[int], settings: RunSettings) -> list[dict[str, Any]]:
    """The lines of some episodes; the process keeps its last env."""
    from tral_fsm.evaluation.rollout import drive

    key = (scenario, settings)
    if key not in _kept:
        for env, _ in _kept.values():
            env.close()
        _kept.clear()
        _kept[key] = _make(scenario, settings)
    env, policy = _kept[key]
    drives = (drive(env, policy, seed, on_step=stop_check(), scenario=scenario) for seed in seeds)
    return [{"kind": "episode", **each.record()} for each in drives]


def _make(scenario: str, settings: RunSettings) -> tuple[Any, Any]:
    import gymnasium as gym

    env = gym.make(
        "tral_env:TralCorridor-v0",
        scenario=scenario,
        camera=settings.camera,
        randomization=settings.randomization,
    )
    return env, load_policy(settings.policy)


def markdown(path: Path, settings: RunSettings) -> str:
    """The file as a Markdown table."""
    episodes = read(path, settings)
    runs = [line["host"] for line in read_lines(path) if line["kind"] == "run"]
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
