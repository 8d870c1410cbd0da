"""A plan from above."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from tral_env.course.draw import COLOURS, draw_figure
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, example_names, example_path
from tral_env.course.plan import BOX_KINDS


def drawn(name: str) -> tuple[Figure, np.ndarray]:
    figure = draw_figure(build_plan(Course.load(example_path(name))), name)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return figure, np.asarray(canvas.buffer_rgba())[..., :3] / 255


def test_every_kind_of_box_has_a_colour():
    assert tuple(COLOURS) == BOX_KINDS


@pytest.mark.parametrize("name", example_names())
def test_the_whole_course_is_in_the_picture(name: str):
    plan = build_plan(Course.load(example_path(name)))
    figure, _ = drawn(name)
    (left, right), (low, high) = figure.axes[0].get_xlim(), figure.axes[0].get_ylim()
    for (x, y, _), reach in zip(plan.box_position, plan.box_size.min(axis=1), strict=True):
        assert left <= x - reach <= x + reach <= right
        assert low <= y - reach <= y + reach <= high
    assert figure.axes[0].get_aspect() == 1


@pytest.mark.parametrize("kind", ["wall", "door", "obstacle"])
def test_boxes_are_seen_in_their_colour(kind: str):
    _, pixels = drawn("default")
    assert (np.abs(pixels - to_rgb(COLOURS[kind])).max(axis=2) < 0.02).sum() > 20
