"""A plan from above."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from tral_env.course.draw import COLOURS, draw_figure, goal_line
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, example_names, example_path
from tral_env.course.plan import BOX_KINDS
from tral_env.se2 import rotate_n
from tral_env.task import empty_track, lay, locate


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


@pytest.mark.parametrize("name", example_names())
def test_the_goal_is_drawn_from_wall_to_wall(name: str):
    plan = build_plan(Course.load(example_path(name)))
    ends = goal_line(plan)
    line = next(line for line in draw_figure(plan).axes[0].lines if line.get_label() == "goal")
    assert pytest.approx(ends) == np.array(line.get_data()).T
    outside = ends + 0.001 * (ends - ends.mean(axis=0))
    walls = plan.box_kind == BOX_KINDS.index("wall")
    for end in outside:
        off = np.abs(rotate_n(-plan.box_yaw, end - plan.box_position[:, :2]))
        assert (walls & (off < plan.box_size[:, :2]).all(axis=1)).any()


@pytest.mark.parametrize("share", [0.01, 0.3, 0.5, 0.8, 0.99])
@pytest.mark.parametrize("name", example_names())
def test_crossing_the_drawn_goal_anywhere_counts(name: str, share: float):
    plan = build_plan(Course.load(example_path(name)))
    if plan.laps > 1:
        plan = replace(plan, laps=1)
    track = empty_track(1)
    lay(track, 0, plan)
    right, left = goal_line(plan)
    along = plan.route[-1] - plan.route[-2]
    for metres in (-0.02, 0.02):
        place = right + share * (left - right) + metres * along / np.linalg.norm(along)
        s, _, _ = locate(track, np.zeros(1, np.int64), place[None], track.last - 1)
        assert (s[0] >= plan.length - 1e-6) == (metres > 0)
