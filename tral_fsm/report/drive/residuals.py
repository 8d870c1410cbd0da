"""residuals.png: what a recorded drive measured, what the simulated car would have, and the difference."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tral_fsm.evaluation.files import write_figure
from tral_fsm.evaluation.replayed import QUANTITIES, Comparison

_RECORDED, _SIMULATED, _DIFFERENCE = "#0b3c8c", "#d97706", "#a30000"
_DPI = 120


def save_residuals(comparison: Comparison, path: Path) -> None:
    """Draw a comparison into a PNG file."""
    write_figure(path, residual_figure(comparison), _DPI)


def residual_figure(comparison: Comparison) -> Figure:
    """Figure of a comparison: of each quantity both curves, and beside them their difference."""
    figure = Figure(figsize=(13.0, 2.2 * len(QUANTITIES) + 0.8), dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(QUANTITIES), 2, sharex=True, width_ratios=[1.6, 1.0], squeeze=False)
    for (left, right), (name, unit) in zip(grid, QUANTITIES.items(), strict=True):
        _draw_curves(left, comparison, name, unit)
        _draw_difference(right, comparison, name, unit)
    for ax in grid[-1]:
        ax.set_xlabel("time [s]")
    grid[0][0].legend(loc="upper right", fontsize=8)
    ended = f"; the simulated drive ended early: {comparison.outcome.replace('_', ' ')}" if comparison.outcome else ""
    figure.suptitle(f"recorded and simulated on the same commands{ended}", fontsize=11)
    return figure


def _draw_curves(ax: Axes, comparison: Comparison, name: str, unit: str) -> None:
    # The recorded curve is wider and lies below, so that both are seen where they are the same.
    ax.plot(comparison.time_s, comparison.recorded[name], color=_RECORDED, linewidth=2.6, alpha=0.55, label="recorded")
    ax.plot(comparison.time_s, comparison.simulated[name], color=_SIMULATED, linewidth=1.0, label="simulated")
    ax.set_ylabel(f"{name.replace('_', ' ')}\n[{unit}]", fontsize=8)
    ax.grid(alpha=0.3)


def _draw_difference(ax: Axes, comparison: Comparison, name: str, unit: str) -> None:
    found = comparison.residual(name)
    ax.plot(comparison.time_s, found, color=_DIFFERENCE, linewidth=0.9)
    ax.axhline(0.0, color="black", linewidth=0.6)
    known = found[np.isfinite(found)]
    if len(known):
        text = f"RMS {np.sqrt(np.mean(known**2)):.3g} {unit}, largest {np.abs(known).max():.3g} {unit}"
    else:
        text = "not measured"
    ax.set_title(f"difference: {text}", loc="left", fontsize=8)
    ax.grid(alpha=0.3)
