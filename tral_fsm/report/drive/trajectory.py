"""trajectory.png: the path on the course in the colours of the active states; below it the ranges over time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from tral_env.course.draw import draw_plan
from tral_env.course.plan import Plan
from tral_env.interface import CORE_LAYOUT, NO_ECHO_M
from tral_fsm.evaluation.episode import Episode, EpisodeTrace
from tral_fsm.evaluation.files import write_figure
from tral_fsm.report.drive.state_colours import StateColours

SIDES = {"left": "#0b3c8c", "front": "black", "right": "#a30000"}
"""Colour of each ultrasonic's range."""

_WIDTH_IN = 12.0
_MAX_STATES, _MAX_TRANSITS = 12, 18
"""Number of states and of transitions that the legends name."""


def save_trajectory(episode: Episode, plan: Plan, path: Path) -> None:
    """Draw an episode on its course into a PNG file."""
    figure = trajectory_figure(episode, plan)
    write_figure(path, figure, 120)


def trajectory_figure(episode: Episode, plan: Plan) -> Figure:
    """Figure of an episode on its course."""
    trace = episode.trace
    colours = StateColours(trace.states)
    height = _map_height(plan)
    figure = Figure(figsize=(_WIDTH_IN, height + 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    above, below = figure.subplots(2, 1, height_ratios=[height, 3.0])
    draw_plan(plan, above)
    _draw_path(above, trace, colours)
    _draw_transits(above, below, trace)
    _draw_events(above, episode)
    above.set_aspect("equal")
    above.set_title(title(episode), loc="left", parse_math=False)
    _legend_of_states(above, colours)
    _draw_bands(below, trace, colours)
    _draw_ranges(below, trace)
    return figure


def title(episode: Episode) -> str:
    """Outcome and figures of an episode in one line."""
    parts = [
        f"{episode.scenario or 'course'}, seed {episode.seed}: {episode.outcome.replace('_', ' ')}",
        f"{100 * episode.progress:.0f} % in {episode.time_s:.1f} s",
        f"mean {episode.mean_speed:.2f} m/s",
    ]
    if episode.gates_total:
        parts.append(f"gates {episode.gates_passed}/{episode.gates_total}")
    if episode.clearance_samples:
        share = 100 * episode.clearance_samples / len(episode.trace.time)
        parts.append(f"clearance RMSE {100 * episode.clearance_rmse:.1f} cm over {share:.0f} % of the time")
    return "   ".join(parts)


def runs(states: tuple[str, ...]) -> Iterator[tuple[str, int, int]]:
    """Stretches of one state: name, first tick, tick after the last."""
    first = 0
    for i in range(1, len(states) + 1):
        if i == len(states) or states[i] != states[first]:
            yield states[first], first, i
            first = i


def _map_height(plan: Plan) -> float:
    """Height of the map for the shape of the course, inches."""
    points = np.vstack([plan.box_position[:, :2], plan.route])
    wide, high = np.ptp(points, axis=0) + 1.0
    return float(np.clip(_WIDTH_IN * high / wide, 1.6, 9.0))


def _draw_path(ax: Axes, trace: EpisodeTrace, colours: StateColours) -> None:
    xy = trace.pose[:, :2]
    # Each stretch ends at the start of the next, so that the path has no gaps.
    stretches = [(name, xy[first : last + 1]) for name, first, last in runs(trace.states)]
    lines = LineCollection(
        [points for _, points in stretches],
        colors=[colours.unit(name) for name, _ in stretches],
        linewidths=2.2,
        capstyle="round",
        zorder=6,
    )
    ax.add_collection(lines)


def _draw_transits(above: Axes, below: Axes, trace: EpisodeTrace) -> None:
    """Number the transitions of the outermost machine, on the path and over the time."""
    marked: list[NDArray[np.float64]] = []
    last = -math.inf
    for number, tick, _ in outer_transits(trace):
        here, now = trace.pose[tick, :2], trace.time[tick]
        above.plot(*here, "o", color="white", markeredgecolor="black", markersize=4, zorder=7)
        # A number that would cover another one is left out.
        if all(np.hypot(*(here - other)) > np.ptp(above.get_xlim()) / 60.0 for other in marked):
            above.annotate(str(number), (here[0], here[1]), (4, 4), textcoords="offset points", fontsize=7, zorder=9)
            marked.append(here)
        below.axvline(now, color="black", linewidth=0.6, linestyle=":")
        if now - last >= trace.time[-1] / 60.0:
            below.annotate(str(number), (now, 5.2), (1, -8), textcoords="offset points", fontsize=7)
            last = now


def outer_transits(trace: EpisodeTrace) -> list[tuple[int, int, str]]:
    """Transitions of the outermost machine: number from 1 on, tick, id."""
    outer = [(tick, str(transit.transition)) for tick, transit in trace.transits if not transit.path]
    return [(number, tick, name) for number, (tick, name) in enumerate(outer, 1)]


def _legend_of_ranges(ax: Axes, trace: EpisodeTrace) -> None:
    """The ultrasonics, and the names of the numbered transitions."""
    handles, labels = ax.get_legend_handles_labels()
    transits = outer_transits(trace)
    for number, _, name in transits[:_MAX_TRANSITS]:
        handles.append(Patch(alpha=0.0))
        labels.append(f"{number} {name if len(name) <= 26 else name[:24] + '...'}")
    if len(transits) > _MAX_TRANSITS:
        handles.append(Patch(alpha=0.0))
        labels.append(f"and {len(transits) - _MAX_TRANSITS} more")
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.005, 1.0)}
    legend = ax.legend(handles, labels, fontsize=7, frameon=False, labelspacing=0.25, handlelength=1.2, **place)
    for text in legend.get_texts():
        text.set_parse_math(False)  # names of transitions are no formulas


def _draw_events(ax: Axes, episode: Episode) -> None:
    trace = episode.trace
    ax.plot(*trace.pose[0, :2], "o", color="black", markersize=6, zorder=7, label="start")
    passed = np.flatnonzero(np.diff(trace.gates_passed, prepend=0) > 0)
    if len(passed):
        ax.plot(
            *trace.pose[passed, :2].T, "D", color="limegreen", markeredgecolor="black", zorder=7, label="gate passed"
        )
    marks = {"success": "*", "collision": "X", "missed_gate": "P", "timeout": "s"}
    colour = "gold" if episode.success else "red"
    ax.plot(
        *trace.pose[-1, :2],
        marks[episode.outcome],
        color=colour,
        markeredgecolor="black",
        markersize=13,
        zorder=8,
        linestyle="none",
        label=episode.outcome.replace("_", " "),
    )


def _legend_of_states(ax: Axes, colours: StateColours) -> None:
    handles, _ = ax.get_legend_handles_labels()
    patches = [Patch(color=colours.unit(name), label=name) for name in colours.states[:_MAX_STATES] if name]
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.005, 1.0)}
    legend = ax.legend(handles=[*patches, *handles], fontsize=8, frameon=False, **place)
    for text in legend.get_texts():
        text.set_parse_math(False)  # names of states are no formulas


def _draw_bands(ax: Axes, trace: EpisodeTrace, colours: StateColours) -> None:
    edges = np.concatenate([[0.0], trace.time])
    for name, first, last in runs(trace.states):
        ax.axvspan(edges[first], edges[last], color=colours.unit(name), alpha=0.18, linewidth=0)


def _draw_ranges(ax: Axes, trace: EpisodeTrace) -> None:
    for side, colour in SIDES.items():
        ax.plot(trace.time, _echoes(trace, side), color=colour, linewidth=1.0, label=side)
    for t in trace.time[np.diff(trace.gates_passed, prepend=0) > 0]:
        ax.axvline(t, color="limegreen", linewidth=1.5, linestyle="--")
    ax.set_xlim(0.0, float(trace.time[-1]))
    ax.set_ylim(0.0, 5.2)
    ax.set_xlabel("time [s]   (bands: active state; dotted: transitions; gaps: no echo)")
    ax.set_ylabel("ultrasonic range [m]")
    _legend_of_ranges(ax, trace)
    ax.grid(alpha=0.3)


def _echoes(trace: EpisodeTrace, side: str) -> NDArray[np.float64]:
    ranges = trace.readings[:, CORE_LAYOUT.column(f"ultrasonic_{side}")]
    return np.where(ranges < NO_ECHO_M, ranges, np.nan)
