"""Pictures of a comparison, from the figures of `evaluation.analysis` and the plans of its courses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tral_env.course.draw import draw_plan
from tral_env.course.plan import Plan
from tral_env.geometry import LENGTH_M, WHEELBASE_M, WIDTH_M
from tral_env.se2 import to_outer_n

Array = NDArray[np.float64]

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000", "#8b5a2b")
"""Colours that the colour-blind can tell apart (Okabe and Ito), and a brown."""
STYLES = ("-", "--", ":", "-.")
OUTCOMES = {
    "success": "#7fb069",
    "timeout": "#c7c7c7",
    "missed_gate": "#f2c14e",
    "collision": "#d1603d",
}
"""Colour of each outcome."""
_MEASURES = (("success", "success rate"), ("score", "score, mean"), ("iqm", "score, IQM"), ("progress", "progress"))
WIDEST, NARROWEST = 4.5, 1.2
"""Width of the path of the first contender and of the last one, points."""
MAX_IN_A_ROW = 6
"""A row of a legend has so many names at most."""
_AROUND_M = 1.6
"""A picture of a failure shows at least so much around the car, m."""


def style(number: int) -> dict[str, Any]:
    """Colour and line of a contender by its number."""
    return {"color": COLOURS[number % len(COLOURS)], "linestyle": STYLES[number // len(COLOURS) % len(STYLES)]}


def plain(name: str) -> str:
    """A name as a text of a figure, in which $ would begin mathematics."""
    return name.replace("$", r"\$")


def intervals(contenders: Sequence[Mapping[str, Any]]) -> Figure:
    """Figure of the main measures of each contender with their 95 % intervals."""
    whole = Figure(figsize=(10.0, 1.1 + 0.34 * len(contenders)), layout="constrained")
    axes = whole.subplots(1, len(_MEASURES), sharey=True)
    for ax, (name, title) in zip(axes, _MEASURES, strict=True):
        for k, one in enumerate(contenders):
            got = one["figures"][name]
            colour = style(k)["color"]
            low, high = (got["value"] if got[end] is None else got[end] for end in ("low", "high"))
            ax.plot([low, high], [k, k], color=colour, linewidth=5.0, alpha=0.4, solid_capstyle="butt")
            ax.plot(got["value"], k, "o", color=colour, markersize=5.0)
        ax.set_title(title, loc="left", fontsize=10)
        ax.set_xlim(-0.03, 1.03)
        _plain(ax)
    axes[0].set_yticks(range(len(contenders)), [plain(one["name"]) for one in contenders])
    axes[0].set_ylim(len(contenders) - 0.4, -0.6)
    return whole


def outcomes(contenders: Sequence[Mapping[str, Any]]) -> Figure:
    """Figure of how the drives of each contender ended."""
    whole = Figure(figsize=(10.0, 1.2 + 0.32 * len(contenders)), layout="constrained")
    ax = whole.subplots()
    for k, one in enumerate(contenders):
        figures, left = one["figures"], 0.0
        shares = {
            "success": figures["success"]["value"],
            "timeout": figures["timeout_rate"],
            "missed_gate": figures["missed_gate_rate"],
            "collision": figures["collision_rate"],
        }
        for name, share in shares.items():
            label = name.replace("_", " ") if k == 0 else None
            ax.barh(k, share, left=left, color=OUTCOMES[name], height=0.7, label=label)
            left += share
    ax.set_yticks(range(len(contenders)), [plain(one["name"]) for one in contenders])
    ax.set_ylim(len(contenders) - 0.4, -0.6)
    ax.set_xlim(0.0, 1.0)
    ax.set_xlabel("share of the drives")
    _plain(ax)
    whole.legend(loc="outside upper center", ncols=len(OUTCOMES), frameon=False)
    return whole


def profiles(shown: Mapping[str, Any]) -> Figure:
    """Figure of the share of drives above each score, with 95 % bands."""
    whole = Figure(figsize=(10.0, 4.4), layout="constrained")
    ax = whole.subplots()
    for k, (name, one) in enumerate(shown["contenders"].items()):
        ax.fill_between(shown["levels"], one["low"], one["high"], color=style(k)["color"], alpha=0.15, linewidth=0.0)
        ax.plot(shown["levels"], one["value"], linewidth=1.8, label=plain(name), **style(k))
    ax.set_xlabel("score")
    ax.set_ylabel("share of drives above it")
    ax.set_xlim(0.0, 1.0)
    ax.set_ylim(-0.02, 1.02)
    _plain(ax)
    whole.legend(loc="outside right upper", frameon=False)
    return whole


def paths(plan: Plan, contenders: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Figure of the paths of all contenders over one course; a cross marks where one did not arrive."""
    low, high = plan.box_position[:, :2].min(axis=0), plan.box_position[:, :2].max(axis=0)
    wide, tall = high - low
    height = float(np.clip(9.0 * tall / max(wide, 1e-6), 1.3, 6.0)) + 0.8
    whole = Figure(figsize=(10.0, height), layout="constrained")
    ax = whole.subplots()
    draw_plan(plan, ax)
    _as_background(ax)
    for k, (name, one) in enumerate(contenders.items()):
        x, y, _ = np.array(one["path"], float).T
        # Later ones are narrower, so that one that drives the same way hides none below it.
        width = NARROWEST + (WIDEST - NARROWEST) * (1.0 - k / max(len(contenders) - 1, 1))
        ax.plot(x, y, linewidth=width, label=plain(name), zorder=7, **style(k))
        if one["outcome"] != "success":
            ax.plot(x[-1], y[-1], "X", color=style(k)["color"], markersize=9.0, markeredgecolor="white", zorder=8)
    handles, labels = ax.get_legend_handles_labels()
    rows = -(-len(labels) // MAX_IN_A_ROW)
    columns = -(-len(labels) // rows)
    whole.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False, fontsize=9)
    return whole


def failure(plan: Plan, path: Sequence[Sequence[float]], colour: str) -> Figure:
    """Figure of the last seconds of a drive: the path, and the car where it ended."""
    poses = np.array(path, float)
    whole = Figure(figsize=(3.2, 2.9), layout="constrained")
    ax = whole.subplots()
    draw_plan(plan, ax)
    _as_background(ax)
    ax.plot(poses[:, 0], poses[:, 1], color=colour, linewidth=1.8, zorder=7)
    ax.fill(*outline(poses[-1]).T, facecolor=colour, edgecolor="black", linewidth=0.8, alpha=0.85, zorder=8)
    low, high = poses[:, :2].min(axis=0), poses[:, :2].max(axis=0)
    middle, half = (low + high) / 2, max(float((high - low).max()) / 2 + 0.6, _AROUND_M)
    ax.set_xlim(middle[0] - half, middle[0] + half)
    ax.set_ylim(middle[1] - half, middle[1] + half)
    ax.set_xlabel("")
    ax.set_ylabel("")
    ax.tick_params(labelsize=7)
    return whole


def outline(pose: Array) -> Array:
    """Corners (4, 2) [m] of the car at a pose (3,) of its rear axle."""
    rear, front = WHEELBASE_M / 2 - LENGTH_M / 2, WHEELBASE_M / 2 + LENGTH_M / 2
    half = WIDTH_M / 2
    corners = np.array([[rear, -half], [front, -half], [front, half], [rear, half]])
    placed: Array = to_outer_n(np.tile(pose, (4, 1)), corners)
    return placed


def _as_background(ax: Axes) -> None:
    """Keep the course out of the legend, which names contenders alone, and its texts above the paths."""
    for drawn in ax.lines:
        drawn.set_label("_" + str(drawn.get_label()))
    for text in ax.texts:
        text.set(zorder=9, clip_on=True, bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 0.6})


def _plain(ax: Axes) -> None:
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(True, axis="x", alpha=0.3, linewidth=0.6)
    ax.set_axisbelow(True)
