"""A plan from above, drawn with matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array
from tral_env.course.plan import BOX_KINDS, Plan
from tral_env.interface import TURN_MARKER_IDS
from tral_env.se2 import rotate_n, to_outer

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {"wall": "#8c959d", "door": "#b5651d", "frame": "#3f4750", "obstacle": "#c9a227", "post": "#2a6bb0"}
"""Each kind of box has a fill of its own."""
SIGN_TEXTS = {marker: "straight on" if turn == "straight" else turn for turn, marker in TURN_MARKER_IDS.items()}
"""A sign tells this turn, by the id of its marker."""

_OPEN_M = 3.0
"""So far the goal line is drawn where no wall ends it, m."""


def draw_figure(plan: Plan, title: str = "", width: float = 8.0) -> Figure:
    """Draw a plan into a figure of its own, as high as the course needs.

    Args:
        plan: the course.
        title: the text above the picture.
        width: width of the figure, inch.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    x, y = np.ptp(plan.box_position[:, :2], axis=0)
    figure = Figure(figsize=(width, float(np.clip(1.2 + width * y / x, 2.2, 0.9 * width))), layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.add_subplot()
    draw_plan(plan, ax)
    ax.set_title(title, loc="left", fontsize=10)
    return figure


def draw_plan(plan: Plan, ax: Axes) -> None:
    """Draw walls, doors, obstacles, gates, markers, tape, the route, start and goal.

    Args:
        plan: the course.
        ax: the axes, in m; their limits and aspect are set.
    """
    from matplotlib.collections import LineCollection, PolyCollection

    for kind, colour in COLOURS.items():
        corners = _corners(plan, plan.box_kind == BOX_KINDS.index(kind))
        ax.add_collection(PolyCollection(list(corners), facecolor=colour, edgecolor=colour, linewidth=0.6, zorder=2))
    ax.add_collection(LineCollection(list(plan.tape.reshape(-1, 2, 2)), color="black", linewidth=2.0, zorder=1))
    ax.plot(*plan.route.T, color="#2e7d32", linewidth=1.0, linestyle=(0, (4, 3)), zorder=3, label="route")
    _draw_gates(plan, ax)
    _draw_markers(plan, ax)
    _draw_ends(plan, ax)
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.set_xlabel("x [m]")
    ax.set_ylabel("y [m]")


def _corners(plan: Plan, which: NDArray[np.bool_]) -> Array:
    """Corners of some boxes, (k, 4, 2), course frame; `which` is (B,)."""
    half = plan.box_size[which, None, :2] * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    corners: Array = plan.box_position[which, None, :2] + rotate_n(plan.box_yaw[which, None], half)
    return corners


def _draw_gates(plan: Plan, ax: Axes) -> None:
    for (x, y, yaw), width, gate in zip(plan.gate_pose, plan.gate_width, plan.gate_id, strict=True):
        (x0, y0), (x1, y1) = (to_outer((x, y, yaw), 0.0, left) for left in (-width / 2, width / 2))
        ax.plot([x0, x1], [y0, y1], color=COLOURS["post"], linewidth=1.0, zorder=3)
        ax.annotate(f"gate {gate}", (x, y), (4, 4), textcoords="offset points", fontsize=7, color=COLOURS["post"])


def _draw_markers(plan: Plan, ax: Axes) -> None:
    for (x, y, _), yaw, marker in zip(plan.marker_position, plan.marker_yaw, plan.marker_id, strict=True):
        normal = 0.25 * np.array([np.cos(yaw), np.sin(yaw)])
        ax.plot([x, x + normal[0]], [y, y + normal[1]], color="#c2185b", linewidth=1.2, zorder=4)
        if int(marker) in SIGN_TEXTS:
            at, box = (x + 2 * normal[0], y + 2 * normal[1]), {"fc": "white", "ec": "none", "alpha": 0.8, "pad": 1}
            ax.annotate(
                SIGN_TEXTS[int(marker)], at, ha="center", va="center", color="#c2185b", fontsize=8, bbox=box, zorder=5
            )


def _draw_ends(plan: Plan, ax: Axes) -> None:
    x, y, yaw = plan.start
    ax.plot(x, y, marker=(3, 0, np.degrees(yaw) - 90), markersize=9, color="#2e7d32", zorder=5)
    ax.plot(*goal_line(plan).T, color="#d32f2f", linewidth=2.5, zorder=4, label="goal")


def goal_line(plan: Plan) -> Array:
    """Ends (2, 2) [m], right and left, of the line that counts as the goal: square to the route, from wall to wall."""
    along = plan.route[-1] - plan.route[-2]
    left = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    return np.stack([plan.route[-1] + way * _room(plan, way) for way in (-left, left)])


def _room(plan: Plan, way: Array) -> float:
    """Distance from the end of the route to the first box that way, a unit vector (2,), m."""
    off, half = plan.route[-1] - plan.box_position[:, :2], plan.box_size[:, :2]
    start, step = rotate_n(-plan.box_yaw, off), rotate_n(-plan.box_yaw, np.broadcast_to(way, off.shape))
    step = np.where(np.abs(step) < 1e-9, 1e-9, step)  # along a face: its two crossings lie far away
    crossings = np.sort(np.stack([(-half - start) / step, (half - start) / step]), axis=0)
    enters, leaves = crossings[0].max(axis=1), crossings[1].min(axis=1)
    ahead = enters[(enters <= leaves) & (enters >= 0.0)]
    return float(ahead.min(initial=_OPEN_M))
