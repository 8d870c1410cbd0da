"""Draw the plots of docs/perception.md from the results of marker_accuracy.py and gate_accuracy.py.

Usage: python benchmarks/plot_perception.py [FOLDER]        (default: docs/img)
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

Row = dict[str, Any]
RESULTS = Path(__file__).parent / "results"
COLOURS = {"off": "#222222", "mild": "#1f6fb2", "strong": "#c8452e"}
CLEAR_SEEDS = {"streak": 10, "patch": 38}
"""Seeds that give a long streak, and a patch that covers a marker."""
LENSES = {"default": "-", "wide": ":", "320 x 240": "--", "1280 x 960": "-."}


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "docs" / "img"
    folder.mkdir(parents=True, exist_ok=True)
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True})
    plt.rcParams.update({"grid.color": "#e5e5e5", "legend.frameon": False})
    for draw in (marker_accuracy, marker_lenses, gate_accuracy, image_faults):
        figure = draw()
        figure.tight_layout()
        figure.savefig(folder / f"{draw.__name__}.png", dpi=110)
        plt.close(figure)


def read(name: str) -> Any:
    """Content of a result file."""
    return json.loads((RESULTS / name).read_text(encoding="utf-8"))


def curves(axes: Axes, rows: list[Row], name: str, level: str, index: int | None = None) -> None:
    """Plot a quantity over distance, solid for the rendered and dashed for the projected camera."""
    for camera, dash in (("rendered", "-"), ("projected", "--")):
        points = [(row["distance_m"], row[camera][name]) for row in rows if row[camera][name] is not None]
        values = [value if index is None else value[index] for _, value in points]
        axes.plot([at for at, _ in points], values, dash, marker="o", ms=2.5, lw=1.2, color=COLOURS[level])


def marker_accuracy() -> plt.Figure:
    """Rate of detection, errors of position and heading of a single marker."""
    table = read("marker_accuracy.json")["default"]["distance"]
    figure, grid = plt.subplots(2, 3, figsize=(8.6, 5.0), sharex=True)
    for axes_row, angle in zip(grid, ("0 to 25", "25 to 50"), strict=True):
        for level in COLOURS:
            # Quantiles of less than ten detections say little.
            rows = [row for row in table if row["level"] == level and row["angle_deg"] == angle]
            enough = [row for row in rows if row["rendered"]["rate"] * row["views"] >= 10]
            curves(axes_row[0], rows, "rate", level)
            curves(axes_row[1], enough, "position_percent", level, 1)
            curves(axes_row[2], enough, "heading_deg", level, 0)
        axes_row[0].set(ylabel=f"{angle} deg\nfound", ylim=(-0.03, 1.03))
        axes_row[1].set(ylabel="position, 95 % [% of distance]", ylim=(0, None))
        axes_row[2].set(ylabel="heading, median [deg]", ylim=(0, 20))
    _legend(grid[0, 0])
    for axes in grid[1]:
        axes.set_xlabel("distance [m]")
    return figure


def _legend(axes: Axes) -> None:
    for level, colour in COLOURS.items():
        axes.plot([], [], color=colour, label=level)
    axes.plot([], [], "-", color="#9a9a9a", label="rendered")
    axes.plot([], [], "--", color="#9a9a9a", label="projected")
    axes.legend(loc="lower left", fontsize=8)


def marker_lenses() -> plt.Figure:
    """Rate of detection over distance, for each lens."""
    result = read("marker_accuracy.json")
    figure, panels = plt.subplots(1, 3, figsize=(8.6, 2.8), sharey=True)
    for axes, level in zip(panels, COLOURS, strict=True):
        for lens, dash in LENSES.items():
            table = result[lens]["distance"]
            rows = [row for row in table if row["level"] == level and row["angle_deg"] == "0 to 25"]
            at, rate = [row["distance_m"] for row in rows], [row["rendered"]["rate"] for row in rows]
            axes.plot(at, rate, dash, marker="o", ms=2.5, color=COLOURS[level], label=lens)
        axes.set(title=level, xlabel="distance [m]", ylim=(-0.03, 1.03))
        axes.legend(loc="lower left", fontsize=8)
    panels[0].set_ylabel("found, 0 to 25 deg")
    return figure


def gate_accuracy() -> plt.Figure:
    """Errors of the middle and the axis of a gate."""
    table = read("gate_accuracy.json")["distance"]
    figure, panels = plt.subplots(1, 4, figsize=(9.6, 2.8))
    for level in COLOURS:
        rows = [row for row in table if row["level"] == level]
        curves(panels[0], rows, "rate", level)
        enough = [row for row in rows if row["rendered"]["rate"] * row["views"] >= 10]
        for axes, name in zip(panels[1:], ("along_cm", "across_cm", "axis_deg"), strict=True):
            curves(axes, enough, name, level, 1)
    panels[0].set(ylabel="both markers found", ylim=(-0.03, 1.03))
    for axes, label in zip(panels[1:], ("middle, along [cm]", "middle, across [cm]", "axis [deg]"), strict=True):
        axes.set(ylabel=f"{label}, 95 %", ylim=(0, None))
    for axes in panels:
        axes.set_xlabel("distance [m]")
    _legend(panels[0])
    return figure


def image_faults() -> plt.Figure:
    """The same gate 3 m away with each fault; this picture alone needs OpenGL."""
    from marker_views import LEVELS, SINGLE, MarkerRoom

    from tral_env.perception.degrade import degrade

    room, faults = MarkerRoom(), LEVELS | SINGLE
    room.show([(6, 3.0, 0.5, 0.25, math.pi), (7, 3.0, -0.5, 0.25, math.pi)])
    figure, panels = plt.subplots(3, 3, figsize=(7.2, 3.6))
    for axes, (name, (level, corruption)) in zip(panels.flat, faults.items(), strict=True):
        image = degrade(room.image, level, np.random.default_rng(CLEAR_SEEDS.get(name, 2)), corruption)
        seen = len(room.detector.detect(image).ids)
        axes.imshow(image[150:300, 160:500], interpolation="nearest")
        axes.set_title(f"{name}: {seen} found", fontsize=8)
        axes.axis("off")
    room.close()
    return figure


if __name__ == "__main__":
    main()
