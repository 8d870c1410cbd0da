"""trajectory.png: the path on the course in the colours of the active states; below it the ranges over time."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.text import Annotation
from numpy.typing import NDArray

from tral_env.course.draw import draw_plan
from tral_env.course.plan import Plan
from tral_env.interface import CORE_LAYOUT
from tral_fsm.estimation.sonar import MAX_ECHO_RANGE_M
from tral_fsm.evaluation.episode import Episode, EpisodeTrace
from tral_fsm.evaluation.files import write_figure
from tral_fsm.report.drive.labels import Label, place_labels
from tral_fsm.report.drive.state_colours import StateColours

SIDES = {"left": "#0b3c8c", "front": "black", "right": "#a30000"}
"""Colour of each ultrasonic's range."""

_WIDTH_IN, _RANGES_IN = 12.0, 3.2
_DPI = 120
_LINE_IN = 0.16
"""Height of a line of a legend."""
_CHARACTER_IN = 0.07
"""Width of a character of a legend."""
_MAX_TRANSITS = 90
"""Number of transitions that the legend names."""
_MAX_CHARACTERS = 60
"""Length from which on a name in a legend is cut."""


def save_trajectory(episode: Episode, plan: Plan, path: Path, tones: Mapping[str, str] | None = None) -> None:
    """Draw an episode on its course into a PNG file; `tones` as in `trajectory_figure`."""
    write_figure(path, trajectory_figure(episode, plan, tones), _DPI)


def trajectory_figure(episode: Episode, plan: Plan, tones: Mapping[str, str] | None = None) -> Figure:
    """Figure of an episode on its course.

    Args:
        episode: the episode.
        plan: its course.
        tones: colours of states by name, see `tral_fsm.draw.panels.state_tones`; None: by first tick.
    """
    return _figure(episode.trace, title(episode), tones, plan, episode)


def save_recorded(trace: EpisodeTrace, heading: str, path: Path, tones: Mapping[str, str] | None = None) -> None:
    """Draw a drive on a course that nobody knows into a PNG file: its path, and the ranges over time.

    Args:
        trace: the drive; its poses may be dead reckoning.
        heading: a line above the picture.
        path: the file.
        tones: as in `trajectory_figure`.
    """
    write_figure(path, _figure(trace, heading, tones), _DPI)


def _figure(
    trace: EpisodeTrace,
    heading: str,
    tones: Mapping[str, str] | None,
    plan: Plan | None = None,
    episode: Episode | None = None,
) -> Figure:
    """Path and ranges of a drive, on its course and with its outcome where these are known."""
    colours = StateColours(trace.states, tones)
    named = _named_transits(trace)
    points = trace.pose[:, :2] if plan is None else np.vstack([plan.box_position[:, :2], plan.route])
    parts = [_map_height(points), _LINE_IN * _lines(_shown(colours), 11), _RANGES_IN, _LINE_IN * _lines(named, 0)]
    figure = Figure(figsize=(_WIDTH_IN, sum(parts) + 1.2), dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    above, legend, below, names = figure.subplots(4, 1, height_ratios=[max(part, 0.01) for part in parts])
    if plan is not None:
        draw_plan(plan, above)
    _draw_path(above, trace, colours)
    _draw_events(above, trace)
    if episode is not None:
        _draw_outcome(above, episode)
    else:
        above.margins(x=0.05, y=0.3)
        above.autoscale_view()
        above.set_xlabel("x [m]")
        above.set_ylabel("y [m]")
    above.set_aspect("equal")
    above.set_title(textwrap.fill(heading, 130), loc="left", fontsize=11, parse_math=False)
    _draw_bands(below, trace, colours)
    _draw_ranges(below, trace)
    _draw_legend(legend, above, below, colours)
    _draw_names(names, named)
    _number_transits(above, below, trace)
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


def _map_height(points: NDArray[np.float64]) -> float:
    """Height of the map for the shape of what it shows, (N, 2) points in m; inches."""
    wide, high = np.ptp(points, axis=0) + 1.0
    return float(np.clip(_WIDTH_IN * high / wide, 1.6, 9.0))


def _draw_path(ax: Axes, trace: EpisodeTrace, colours: StateColours) -> None:
    xy = trace.pose[:, :2]
    # Each stretch ends at the start of the next, so that the path has no gaps.
    stretches = [(name, xy[first : last + 1]) for name, first, last in runs(trace.states)]
    lines = LineCollection(
        [points for _, points in stretches],
        colors=[colours.tone(name) for name, _ in stretches],
        linewidths=2.2,
        capstyle="round",
        zorder=6,
    )
    ax.add_collection(lines)


def _number_transits(above: Axes, below: Axes, trace: EpisodeTrace) -> None:
    """Number the transitions of the outermost machine over the time and on the path, clear of the labels of the map."""
    transits = outer_transits(trace)
    for _, tick, _ in transits:
        above.plot(*trace.pose[tick, :2], "o", color="white", markeredgecolor="black", markersize=4, zorder=7)
        below.axvline(trace.time[tick], color="black", linewidth=0.6, linestyle=":")
    labels = [Label(note.get_text(), note.xy, str(note.get_color())) for note in _notes(above)]
    for note in _notes(above):
        note.remove()
    _number_times(below, [(number, float(trace.time[tick])) for number, tick, _ in transits])
    figure: Any = above.figure
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    numbers = [Label(str(number), (trace.pose[tick, 0], trace.pose[tick, 1])) for number, tick, _ in transits]
    place_labels(above, [*labels, *numbers])


def _notes(ax: Axes) -> list[Annotation]:
    return [text for text in ax.texts if isinstance(text, Annotation)]


def _number_times(ax: Axes, numbers: Sequence[tuple[int, float]]) -> None:
    """Numbers above the axes, in the lowest row that has room; what finds no room in four rows is left out."""
    ends = [-math.inf] * 4
    for number, time in numbers:
        row = next((row for row, end in enumerate(ends) if time >= end), None)
        if row is not None:
            ends[row] = time + ax.get_xlim()[1] * (0.006 + 0.006 * len(str(number)))
            ax.annotate(
                str(number), (time, 1.0), (0, 2 + 8 * row), xycoords=("data", "axes fraction"),
                textcoords="offset points", ha="center", fontsize=7,
            )  # fmt: skip


def outer_transits(trace: EpisodeTrace) -> list[tuple[int, int, str]]:
    """Transitions of the outermost machine: number from 1 on, tick, id."""
    outer = [(tick, str(transit.transition)) for tick, transit in trace.transits if not transit.path]
    return [(number, tick, name) for number, (tick, name) in enumerate(outer, 1)]


def _named_transits(trace: EpisodeTrace) -> list[str]:
    """Numbers and names of the transitions, for their legend."""
    transits = outer_transits(trace)
    named = [f"{number} {_cut(name)}" for number, _, name in transits[:_MAX_TRANSITS]]
    return [*named, f"and {len(transits) - _MAX_TRANSITS} more"] if len(transits) > _MAX_TRANSITS else named


def _cut(name: str) -> str:
    return name if len(name) <= _MAX_CHARACTERS else f"{name[: _MAX_CHARACTERS - 3]}..."


def _columns(texts: Sequence[str]) -> int:
    """Number of columns in which texts fill the width of the figure."""
    widest = max(map(len, texts), default=0) + 6
    return max(1, int(0.95 * _WIDTH_IN / (_CHARACTER_IN * widest)))


def _lines(texts: Sequence[str], more: int) -> int:
    """Number of lines that texts, and some more of them, need in columns."""
    return -(-(len(texts) + more) // _columns(texts))


def _draw_names(ax: Axes, named: Sequence[str]) -> None:
    """The names of the numbered transitions."""
    ax.axis("off")
    if named:
        _legend(ax, [Patch(alpha=0.0)] * len(named), named, handlelength=0.0, handletextpad=0.0)


def _legend(ax: Axes, handles: Sequence[Any], labels: Sequence[str], **style: Any) -> None:
    """A legend in columns that fills its axes."""
    legend = ax.legend(
        handles, labels, ncols=_columns(labels), loc="upper left", fontsize=8, frameon=False,
        labelspacing=0.3, borderaxespad=0.0, borderpad=0.0, **style,
    )  # fmt: skip
    for text in legend.get_texts():
        text.set_parse_math(False)  # names are no formulas


def _draw_events(ax: Axes, trace: EpisodeTrace) -> None:
    ax.plot(*trace.pose[0, :2], "o", color="black", markersize=6, zorder=7, label="start")
    passed = np.flatnonzero(np.diff(trace.gates_passed, prepend=0) > 0)
    if len(passed):
        ax.plot(
            *trace.pose[passed, :2].T, "D", color="limegreen", markeredgecolor="black", zorder=7, label="gate passed"
        )


def _draw_outcome(ax: Axes, episode: Episode) -> None:
    trace = episode.trace
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


def _shown(colours: StateColours) -> list[str]:
    return [_cut(name) for name in colours.states if name]


def _draw_legend(ax: Axes, above: Axes, below: Axes, colours: StateColours) -> None:
    """The states, and what else the map and the ranges show."""
    ax.axis("off")
    drawn = [above.get_legend_handles_labels(), below.get_legend_handles_labels()]
    handles = [handle for found, _ in drawn for handle in found]
    labels = [label for _, found in drawn for label in found]
    patches = [Patch(color=colours.tone(name)) for name in colours.states if name]
    _legend(ax, [*patches, *handles], [*_shown(colours), *labels], handlelength=1.4)


def _draw_bands(ax: Axes, trace: EpisodeTrace, colours: StateColours) -> None:
    edges = np.concatenate([[0.0], trace.time])
    for name, first, last in runs(trace.states):
        ax.axvspan(edges[first], edges[last], color=colours.tone(name), alpha=0.18, linewidth=0)


def _draw_ranges(ax: Axes, trace: EpisodeTrace) -> None:
    for side, colour in SIDES.items():
        ax.plot(trace.time, _echoes(trace, side), color=colour, linewidth=1.0, label=f"range {side}")
    for side, sign in (("left", 1.0), ("right", -1.0)):
        wanted = np.where(trace.wanted[:, 0] == sign, trace.wanted[:, 1], np.nan)
        if np.isfinite(wanted).any():
            ax.plot(trace.time, wanted, color=SIDES[side], linewidth=2.5, alpha=0.45, label=f"wanted clearance {side}")
    for t in trace.time[np.diff(trace.gates_passed, prepend=0) > 0]:
        ax.axvline(t, color="limegreen", linewidth=1.5, linestyle="--")
    ax.set_xlim(0.0, float(trace.time[-1]))
    ax.set_ylim(0.0, 5.2)
    ax.set_xlabel("time [s]   (bands: active state; dotted: transitions; gaps: no echo)")
    ax.set_ylabel("ultrasonic range [m]")
    ax.grid(alpha=0.3)


def _echoes(trace: EpisodeTrace, side: str) -> NDArray[np.float64]:
    ranges = trace.readings[:, CORE_LAYOUT.column(f"ultrasonic_{side}")]
    return np.where(ranges < MAX_ECHO_RANGE_M, ranges, np.nan)
