"""Pictures of a search: its progress, the cost around its result, the clearance before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from tral_fsm.evaluation.episode import EpisodeResult
from tral_fsm.evaluation.metrics import ERROR_BINS
from tral_fsm.tuning.landscape import CostLine, CostPlane
from tral_fsm.tuning.objective import PARTS
from tral_fsm.tuning.parameters import Parameter
from tral_fsm.tuning.search.space import Trial

Array = NDArray[np.float64]

OLD, NEW, QUIET, BAD = "#7f7f7f", "#1f77b4", "#c7c7c7", "#d62728"
"""Colours of the old machine, the new one, the background, and failures."""
_MARKS = ("#ffffff", "#ff7f0e", "#2ca02c", "#e377c2", "#17becf")
_UNITS = {"clearance": ("clearance RMSE [cm]", 100.0), "time": ("time [s/m]", 1.0), "steering": ("steering [1/m]", 1.0)}


def figure(width: float = 7.0, height: float = 3.6) -> tuple[Figure, Axes]:
    """A figure with one plot."""
    whole = Figure(figsize=(width, height), layout="constrained")
    ax = whole.subplots()
    _plain(ax)
    return whole, ax


def _plain(ax: Axes) -> None:
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(True, alpha=0.25, linewidth=0.6)
    ax.set_axisbelow(True)


def named(parameter: Parameter) -> str:
    """Label of an axis."""
    return f"{parameter.label} [{parameter.unit}]" if parameter.unit else parameter.label


def convergence(trials: Sequence[Trial], old: Trial) -> Figure:
    """Figure of the cost of each candidate and of the best so far, over the drives."""
    whole, ax = figure()
    drives = np.cumsum([each.drives for each in trials])
    cost = np.array([each.cost for each in trials])
    full = np.array([each.full for each in trials])
    failed = np.array([each.successes < each.drives for each in trials])
    if not full.all():
        ax.scatter(drives[~full], cost[~full], s=9, color=QUIET, label="dropped out of its race")
    for mask, colour, name in ((full & ~failed, NEW, "all drives arrived"), (full & failed, BAD, "some failed")):
        if mask.any():
            ax.scatter(drives[mask], cost[mask], s=13, color=colour, alpha=0.7, label=name)
    best = np.minimum.accumulate(np.where(full, cost, np.inf))
    ax.step(drives, best, where="post", color="black", linewidth=1.4, label="best so far")
    ax.axhline(old.cost, color=OLD, linestyle="--", label="machine as it was")
    if cost.max() > 4.0 * cost.min():
        ax.set_yscale("log")
        for formatter in (ax.yaxis.set_major_formatter, ax.yaxis.set_minor_formatter):
            formatter(lambda value, _: f"{value:.3g}" if f"{value:e}"[0] in "1235" else "")
    ax.set_xlabel("drives")
    ax.set_ylabel("cost")
    _legend_above(ax, left=-0.05, ncols=5, handletextpad=0.3)
    return whole


def plane(found: CostPlane, marks: Mapping[str, tuple[float, float]]) -> Figure:
    """Figure of the cost over two parameters; crosses mark cells with drives that hit a wall, dots other failures.

    Args:
        found: the grid.
        marks: name -> (x, y) of points to mark.
    """
    whole, ax = figure(7.2, 5.4)
    arrived = found.cost[found.failed == 0.0]
    low, top = float(np.nanmin(found.cost)), float(np.nanmax(arrived if arrived.size else found.cost))
    colours = colormaps["viridis_r"].with_extremes(over="#dddddd")
    shown = ax.pcolormesh(
        _edges(found.xs, found.x.log),
        _edges(found.ys, found.y.log),
        found.cost,
        cmap=colours,
        vmin=low,
        vmax=max(top, low + 1e-6),
    )
    whole.colorbar(shown, ax=ax, label="cost; grey: more than any that arrives", extend="max")
    _draw_failures(ax, found)
    _draw_marks(ax, found, marks)
    if found.x.log:
        ax.set_xscale("log")
    if found.y.log:
        ax.set_yscale("log")
    for axis, values in ((ax.xaxis, found.xs), (ax.yaxis, found.ys)):
        _ticks(axis, values[::2])
    ax.grid(False)
    ax.set_xlabel(named(found.x), parse_math=False)
    ax.set_ylabel(named(found.y), parse_math=False)
    _legend_above(ax, ncols=3, markerscale=0.7)
    return whole


def _draw_failures(ax: Axes, found: CostPlane) -> None:
    """Draw a cross into each cell with drives that hit a wall, a dot into each with other failures."""
    x, y = np.meshgrid(found.xs, found.ys)
    hit = found.collided > 0.0
    missed = (found.failed > 0.0) & ~hit
    if hit.any():
        ax.scatter(x[hit], y[hit], s=20 + 50 * found.collided[hit], marker="x", color=BAD, label="drives hit a wall")
    if missed.any():
        ax.scatter(x[missed], y[missed], s=14, color=BAD, label="drives do not arrive")


def _draw_marks(ax: Axes, found: CostPlane, marks: Mapping[str, tuple[float, float]]) -> None:
    """Draw named points; a point outside the plane is in the legend alone."""
    for k, (name, (at, up)) in enumerate(marks.items()):
        inside = found.xs[0] <= at <= found.xs[-1] and found.ys[0] <= up <= found.ys[-1]
        style: dict[str, Any] = {
            "marker": "X*sPD"[k % 5],
            "markersize": 13,
            "markeredgecolor": "black",
            "color": _MARKS[k % 5],
        }
        ax.plot(*((at, up) if inside else (np.nan, np.nan)), label=name if inside else f"{name} (outside)",
                linestyle="none", zorder=5, **style)  # fmt: skip


def _legend_above(ax: Axes, left: float = 0.0, **style: Any) -> None:
    """Put a legend above the plot, where it covers nothing."""
    place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (left, 1.0), "frameon": False}
    ax.legend(fontsize=8, **place, **style)


def _ticks(axis: Axis, values: Array) -> None:
    """Set ticks at these values alone: those of matplotlib overlap on a logarithmic scale of less than a decade."""
    axis.set_ticks(values, [f"{value:.3g}" for value in values])
    axis.set_minor_locator(NullLocator())


def _edges(places: Array, log: bool) -> Array:
    """Edges of cells around evenly spaced places on a logarithmic or linear scale."""
    at = np.log(places) if log else places
    half = (at[1] - at[0]) / 2.0
    edges = np.append(at - half, at[-1] + half)
    return np.exp(edges) if log else edges


def sensitivity(lines: Sequence[CostLine], values: Sequence[float], before: Sequence[float]) -> Figure:
    """Cost along each parameter, the others as found.

    Args:
        lines: one a parameter.
        values: what was found, in the order of the lines.
        before: what was there.
    """
    columns = min(len(lines), 3)
    rows = -(-len(lines) // columns)
    whole = Figure(figsize=(1.0 + 2.9 * columns, 0.5 + 2.4 * rows), layout="constrained")
    axes = np.atleast_1d(whole.subplots(rows, columns, sharey=True)).ravel()
    costs = np.concatenate([line.cost for line in lines])
    low = float(np.nanmin(costs))
    top = max(min(float(np.nanmax(costs)), 4.0 * low), 1.01 * low)
    for ax, line, value, old in zip(axes, lines, values, before, strict=False):
        _plain(ax)
        ax.plot(line.values, line.cost, "-o", color=NEW, markersize=3)
        bad = line.failed > 0.0
        ax.plot(line.values[bad], np.minimum(line.cost[bad], top), "x", color=BAD, markersize=6)
        ax.axvline(value, color="black", linewidth=1.2)
        if line.parameter.log:
            ax.set_xscale("log")
            _ticks(ax.xaxis, line.values[:: max(1, (len(line.values) - 1) // 4)])
        if old > 0.0 or not line.parameter.log:  # 0 has no place on a scale of factors
            ax.axvline(old, color=OLD, linestyle="--", linewidth=1.0)
        ax.set_ylim(low - 0.06 * (top - low), top + 0.06 * (top - low))
        ax.set_xlabel(named(line.parameter), fontsize=8, parse_math=False)
    for ax in axes[::columns]:
        ax.set_ylabel("cost")
    for ax in axes[len(lines) :]:
        ax.set_visible(False)
    return whole


def pareto(
    trials: Sequence[Trial],
    front: Sequence[Trial],
    old: Trial,
    chosen: Trial | None,
    objectives: Sequence[str] = tuple(_UNITS),
) -> Figure:
    """Figure of clearance error against time of all full trials, coloured by steering; rings mark the front."""
    *others, last = objectives
    whole, ax = figure(7.0, 4.2)
    arrived = [each for each in trials if each.full and each.successes == each.drives] or list(front)
    x, y, colour = (_column(arrived, name) for name in ("time", "clearance", "steering"))
    dots = ax.scatter(x, y, c=colour, s=18, cmap="plasma")
    whole.colorbar(dots, ax=ax, label=_UNITS["steering"][0])
    ax.scatter(
        _column(front, "time"), _column(front, "clearance"), s=70, facecolors="none", edgecolors="black",
        linewidths=0.8, zorder=4, label=f"not beaten in {', '.join(others)} and {last} together",
    )  # fmt: skip
    ax.plot(_column([old], "time"), _column([old], "clearance"), "X", color=OLD, markersize=10, label="as it was")
    if chosen is not None:
        ax.plot(
            _column([chosen], "time"), _column([chosen], "clearance"), "*", color=BAD, markersize=14, label="chosen"
        )
    ax.set_xlabel(_UNITS["time"][0])
    ax.set_ylabel(_UNITS["clearance"][0])
    _legend_above(ax, ncols=3, markerscale=0.7)
    return whole


def _column(trials: Sequence[Trial], name: str) -> Array:
    return np.array([each.parts[PARTS.index(name)] for each in trials]) * _UNITS[name][1]


def histogram(old: Sequence[EpisodeResult], new: Sequence[EpisodeResult]) -> Figure:
    """Histogram of the clearance errors on the held-out courses, without the outer hundredth on either side."""
    whole, ax = figure()
    counts = {name: np.sum([drive.errors for drive in drives], axis=0) for name, drives in (("was", old), ("now", new))}
    edges = 100.0 * ERROR_BINS
    most = 5
    for (name, count), colour in zip(counts.items(), (OLD, NEW), strict=True):
        share = 100.0 * count / max(count.sum(), 1)
        ax.stairs(share, edges, color=colour, fill=name == "now", alpha=0.55 if name == "now" else 1.0, label=name)
        inside = np.flatnonzero((np.cumsum(share) > 1.0) & (np.cumsum(share) < 99.0))
        if inside.size:
            most = max(most, *np.abs(edges[[inside[0], inside[-1] + 1]]).astype(int))
    ax.axvline(0.0, color="black", linewidth=0.8)
    ax.set_xlim(-most - 1, most + 1)
    ax.set_xlabel("true clearance minus wanted [cm]")
    ax.set_ylabel("share of ticks [%]")
    ax.legend(fontsize=8)
    return whole
