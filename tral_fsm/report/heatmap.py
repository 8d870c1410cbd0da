"""A sweep over two gains as a picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from tral_fsm.tune import Cell, best


def sweep_figure(cells: Sequence[Cell], title: str) -> Figure:
    """Clearance RMSE over p and d; a cell in which not every drive succeeded says so."""
    p = sorted({cell.p for cell in cells})
    d = sorted({cell.d for cell in cells})
    error = np.full((len(p), len(d)), np.nan)
    for cell in cells:
        rmse = cell.summary.clearance_rmse_m
        error[p.index(cell.p), d.index(cell.d)] = np.nan if rmse is None else 100.0 * rmse
    figure = Figure(figsize=(2.5 + 1.1 * len(d), 1.8 + 0.8 * len(p)), layout="constrained")
    ax = figure.subplots()
    image = ax.imshow(error, origin="lower", cmap="viridis_r", aspect="auto")
    figure.colorbar(image, ax=ax, label="clearance RMSE [cm]")
    ax.set_xticks(range(len(d)), [f"{value:.3g}" for value in d])
    ax.set_yticks(range(len(p)), [f"{value:.3g}" for value in p])
    ax.set_xlabel("d [steering per m/s]")
    ax.set_ylabel("p [steering per m]")
    ax.set_title(title, loc="left", fontsize=10, parse_math=False)
    middle = np.nanmean(error) if np.isfinite(error).any() else 0.0
    for cell in cells:
        row, column = p.index(cell.p), d.index(cell.d)
        light = error[row, column] > middle
        ax.text(column, row, label(cell), ha="center", va="center", fontsize=9, color="white" if light else "black")
    chosen = best(cells)
    place = d.index(chosen.d) + 0.36, p.index(chosen.p) + 0.33
    ax.plot(*place, "*", color="red", markersize=11, linestyle="none", label="best")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=9, frameon=False)
    return figure


def label(cell: Cell) -> str:
    """What is written into a cell: RMSE in cm, and how many drives succeeded if not all did."""
    figures = cell.summary
    text = "-" if figures.clearance_rmse_m is None else f"{100 * figures.clearance_rmse_m:.1f}"
    if figures.successes < figures.episodes:
        text += f"\n{figures.successes}/{figures.episodes} ok"
    return text
