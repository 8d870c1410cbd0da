"""The terminal's view of a drive: progress on stderr, tables on stdout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from tral_fsm.terminal import narrow_table

if TYPE_CHECKING:
    from rich.table import Table

    from tral_fsm.evaluation.episode import Tick

_EVERY = 16
"""Ticks between two updates of the bar: five updates for a second of driving."""


class DriveProgress:
    """A bar that grows with the progress along the route: hand it to `drive` as `on_step`."""

    def __init__(self, name: str) -> None:
        """Make a bar with this name, on stderr."""
        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TaskProgressColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[state]}", markup=False),
            console=Console(stderr=True),
        )
        self._task = self._bar.add_task(name, total=1.0, state="")

    def __call__(self, tick: Tick) -> None:
        """Show where the car is."""
        if tick.index % _EVERY == 0 or tick.info["success"]:
            self._bar.update(self._task, completed=float(tick.info["progress"]), state=tick.state)

    def __enter__(self) -> DriveProgress:
        """Start the bar."""
        self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        """Stop the bar."""
        self._bar.stop()


def table_of_episodes(report: Mapping[str, Any]) -> Table:
    """Table of a drive: a row for each episode, and a last row over all if there are several."""
    arguments = report["arguments"]
    name = report["episodes"][0]["scenario"]
    title = f"{arguments['policy']} on {name}, {arguments['camera']} camera"
    table = table_of_drive(report["episodes"], title)
    if len(report["episodes"]) > 1:
        table.add_section()
        table.add_row(*_figure_cells(report["figures"]), style="bold")
    return table


def table_of_drive(episodes: Sequence[Mapping[str, Any]], title: str) -> Table:
    """Table with a row for each episode, which is the record of its result."""
    table = narrow_table(title)
    for heading in ("seed", "success"):
        table.add_column(heading, no_wrap=True)
    for heading in ("progress", "time", "mean\nspeed", "clearance\nRMSE", "gates", "collisions"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in episodes:
        table.add_row(*_episode_cells(row))
    return table


def _episode_cells(row: Mapping[str, Any]) -> list[str]:
    outcome = row["outcome"].replace("_", " ")
    if row["outcome"] == "collision":
        outcome = "crash" if row["crash"] else "touch"
    return [
        str(row["seed"]),
        "[green]yes[/]" if row["success"] else f"[red]{outcome}[/]",
        *_shared_cells(row["progress"], row["time_s"], row),
        str(int(row["outcome"] == "collision")),
    ]


def _figure_cells(figures: Mapping[str, Any]) -> list[str]:
    return [
        "all",
        f"{figures['successes']} of {figures['episodes']}",
        *_shared_cells(figures["progress"], figures["time_s"], figures),
        str(figures["collisions"]),
    ]


def _shared_cells(progress: float, time: float | None, row: Mapping[str, Any]) -> list[str]:
    rmse = row["clearance_rmse_m"]
    return [
        f"{100 * progress:.0f} %",
        "-" if time is None else f"{time:.1f} s",
        f"{round(row['mean_speed_mps'], 2) + 0.0:.2f} m/s",  # 0.00, not -0.00
        "-" if rmse is None else f"{100 * rmse:.1f} cm",
        f"{row['gates_passed']}/{row['gates_total']}" if row["gates_total"] else "-",
    ]
