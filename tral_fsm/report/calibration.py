"""The picture of a calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tral_env.calibration.solve import Calibration


def calibration_figure(result: Calibration) -> Figure:
    """Places of the corners in the image, and the error of each view."""
    from matplotlib.figure import Figure

    width, height = result.camera.width, result.camera.height
    figure = Figure(figsize=(11.0, 0.55 * 11.0 * height / width + 0.6), layout="constrained")
    image, bars = figure.subplots(1, 2, width_ratios=(2.2, 1.0))
    _draw_coverage(result, image)
    _draw_errors(result, bars)
    return figure


def _draw_coverage(result: Calibration, ax: Axes) -> None:
    width, height = result.camera.width, result.camera.height
    counts = result.coverage
    rows, columns = counts.shape
    extent = (-0.5, width - 0.5, height - 0.5, -0.5)
    ax.imshow(np.minimum(counts, 20), cmap="Greens", vmin=0, vmax=30, extent=extent, aspect="equal")
    for view in result.views:
        ax.plot(*view.pixels.T, ".", color="0.35", markersize=1.5, alpha=0.6)
    for row in range(rows):
        for column in range(columns):
            place = (column + 0.5) * width / columns, (row + 0.5) * height / rows
            count = int(counts[row, column])
            ax.text(*place, str(count), ha="center", va="center", fontsize=11, color="black" if count else "red")
    ax.set_xticks(np.linspace(0, width, columns + 1) - 0.5, [""] * (columns + 1))
    ax.set_yticks(np.linspace(0, height, rows + 1) - 0.5, [""] * (rows + 1))
    ax.grid(color="0.6", linewidth=0.6)
    ax.tick_params(length=0)
    verdict = "good" if result.good else "poor"
    title = f"{verdict}: {len(result.views)} views used, {len(result.rejected)} rejected; corners in each cell"
    ax.set_title(title, loc="left", fontsize=11)


def _draw_errors(result: Calibration, ax: Axes) -> None:
    ax.bar(np.arange(len(result.errors_px)), result.errors_px, color="tab:green", width=0.8)
    ax.axhline(result.rms_px, color="black", linewidth=1, label=f"all {result.rms_px:.3f} px")
    ax.axhline(
        result.held_out_px, color="tab:red", linewidth=1, linestyle="--", label=f"held out {result.held_out_px:.3f} px"
    )
    ax.set_ylim(0, 1.35 * max(float(result.errors_px.max()), result.held_out_px))
    ax.set_xlabel("view")
    ax.set_title("RMS error of each view [px]", loc="left", fontsize=11)
    ax.legend(loc="upper right", fontsize=9, frameon=False)
