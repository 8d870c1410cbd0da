"""Pictures of a training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

_BLUE, _ORANGE = "#3b6ea8", "#c8602a"


def learning_curve(points: Sequence[Mapping[str, Any]], title: str) -> Figure:
    """Success over time, in the training and on the courses of the validation.

    Args:
        points: those of curve.json.
        title: above the axes.
    """
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    axes = figure.subplots()
    minutes = [point["seconds"] / 60 for point in points]
    validated = [100 * point["validation"]["successes"] / point["validation"]["episodes"] for point in points]
    trained = [
        (x, 100 * point["success"])
        for x, point in zip(minutes, points, strict=True)
        if point.get("success") is not None
    ]
    axes.plot(minutes, validated, "o-", color=_BLUE, label="courses of the validation")
    if trained:
        axes.plot(*zip(*trained, strict=True), ".--", color=_ORANGE, label="latest episodes of the training")
    axes.set(title=title, xlabel="time, min", ylabel="success, %", ylim=(-3, 103), xlim=(0, None))
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
    return figure
