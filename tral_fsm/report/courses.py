"""Courses from above."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from tral_env.course.draw import draw_plan
from tral_env.course.plan import Plan


def course_sheet(plans: Mapping[str, Plan]) -> Figure:
    """Figure of one large course, or of many in three columns.

    Args:
        plans: title -> plan; the figure adds the length of the route to the title.
    """
    columns = min(3, len(plans))
    rows = -(-len(plans) // columns)
    size = (10.0, 8.0) if len(plans) == 1 else (5.0 * columns, 4.0 * rows)
    figure = Figure(figsize=size, layout="constrained")
    for i, (title, plan) in enumerate(plans.items()):
        ax = figure.add_subplot(rows, columns, i + 1)
        draw_plan(plan, ax)
        ax.set_aspect("equal")
        ax.set_title(f"{title}: {plan.length:.1f} m", loc="left", fontsize=10)
    return figure
