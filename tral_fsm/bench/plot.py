"""Pictures of measurements."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure


def speed_figure(result: dict[str, Any]) -> Figure:
    """Figure with a bar of steps per second for each contestant; their lengths stand for the speeds."""
    rows = result["contestants"][::-1]
    figure = Figure(figsize=(8, 0.34 * len(rows) + 1.2), layout="constrained")
    axes = figure.subplots()
    names = [row["name"] for row in rows]
    colours = ["tab:blue" if "native" in name or name == "single env" else "0.7" for name in names]
    bars = axes.barh(names, [row["steps_per_s"] for row in rows], color=colours)
    axes.bar_label(bars, labels=[f"{row['steps_per_s']:,.0f}" for row in rows], padding=3, fontsize=8)
    axes.margins(x=0.13, y=0.01)
    axes.set_xlabel("steps a second (of one car; landmarks: of theirs)")
    axes.grid(axis="x", alpha=0.3)
    return figure
