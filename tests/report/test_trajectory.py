"""The picture of a drive: its numbers are readable, its legends whole, its colours those of the machine's picture."""

from itertools import combinations

import gymnasium as gym
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import tral_env  # noqa: F401
from tral_env.course.generate import generate
from tral_env.course.geometry import build_plan
from tral_fsm import load_machine, load_policy
from tral_fsm.draw.panels import state_tones
from tral_fsm.evaluation.episode import Episode
from tral_fsm.evaluation.rollout import drive
from tral_fsm.report.drive.labels import Label, place_labels
from tral_fsm.report.drive.trajectory import outer_transits, trajectory_figure


def paper() -> Axes:
    """Axes of 400 x 300 px, one data unit a pixel."""
    figure = Figure(figsize=(4.0, 3.0), dpi=100)
    FigureCanvasAgg(figure)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_xlim(0, 400)
    ax.set_ylim(0, 300)
    ax.axis("off")
    return ax


def boxes(notes: list) -> list:
    return [note.get_window_extent() for note in notes]


class TestLabels:
    def test_labels_of_one_point_stand_beside_one_another(self) -> None:
        ax = paper()
        notes = place_labels(ax, [Label(str(k), (200.0, 150.0)) for k in range(12)])
        assert [note.get_text() for note in notes] == [str(k) for k in range(12)]
        assert not [pair for pair in combinations(boxes(notes), 2) if pair[0].overlaps(pair[1])]

    def test_a_label_does_not_stand_on_what_is_drawn(self) -> None:
        ax = paper()
        wall = ax.add_patch(Rectangle((195, 0), 100, 300, color="grey"))
        (note,) = place_labels(ax, [Label("gate 1", (195.0, 150.0))])
        assert not note.get_window_extent().overlaps(wall.get_window_extent())

    def test_a_label_stays_inside_the_axes(self) -> None:
        ax = paper()
        (note,) = place_labels(ax, [Label("a long name", (399.0, 299.0))])
        box = note.get_window_extent()
        assert box.x1 <= 400
        assert box.y1 <= 300

    def test_where_nothing_is_free_a_label_is_written_all_the_same(self) -> None:
        ax = paper()
        ax.add_patch(Rectangle((0, 0), 400, 300, color="grey"))
        (note,) = place_labels(ax, [Label("7", (200.0, 150.0))])
        assert note.get_text() == "7"

    def test_a_label_far_from_its_point_has_a_line_to_it(self) -> None:
        near, far = paper(), paper()
        place_labels(near, [Label("7", (200.0, 150.0))])
        far.add_patch(Rectangle((160, 110), 80, 80, color="grey"))
        place_labels(far, [Label("7", (200.0, 150.0))])
        assert [[note.arrow_patch is not None for note in ax.texts] for ax in (near, far)] == [[False], [False, True]]

    def test_the_same_drawing_gives_the_same_places(self) -> None:
        labels = [Label(str(k), (200.0, 150.0 + k)) for k in range(5)]
        assert [n.xyann for n in place_labels(paper(), labels)] == [n.xyann for n in place_labels(paper(), labels)]


@pytest.fixture(scope="module")
def driven() -> tuple[Episode, Figure]:
    env = gym.make("tral_env:TralCorridor-v0", scenario="loop", randomization="none", max_episode_steps=2400)
    policy = load_policy("loop")
    episode = drive(env, policy, 0)
    tones = state_tones(policy.definition, load_machine)
    figure = trajectory_figure(episode, env.unwrapped.plan, tones)  # type: ignore[attr-defined]
    env.close()
    return episode, figure


def words(ax: Axes) -> list[str]:
    legend = ax.get_legend()
    assert legend is not None
    return [text.get_text() for text in legend.get_texts()]


class TestPicture:
    def test_every_transition_has_its_number_on_the_path_and_its_name_below(self, driven: tuple) -> None:
        episode, figure = driven
        numbered = outer_transits(episode.trace)
        assert len(numbered) >= 6
        on_path = [text.get_text() for text in figure.axes[0].texts if text.get_text()]
        assert on_path == [str(number) for number, _, _ in numbered]
        assert words(figure.axes[3]) == [f"{number} {name}" for number, _, name in numbered]

    def test_no_number_stands_on_another(self, driven: tuple) -> None:
        _, figure = driven
        for ax in (figure.axes[0], figure.axes[2]):
            found = boxes([text for text in ax.texts if text.get_text()])
            assert not [pair for pair in combinations(found, 2) if pair[0].overlaps(pair[1])]

    def test_the_legend_names_every_state_in_the_colour_of_the_machine_s_picture(self, driven: tuple) -> None:
        episode, figure = driven
        states = list(dict.fromkeys(episode.trace.states))
        tones = state_tones(load_machine("loop"), load_machine)
        legend = figure.axes[1].get_legend()
        assert words(figure.axes[1])[: len(states)] == states
        assert [to_hex(patch.get_facecolor()) for patch in legend.get_patches()] == [tones[name] for name in states]

    def test_the_wanted_clearance_is_drawn_where_a_state_keeps_one(self, driven: tuple) -> None:
        episode, figure = driven
        lines = {line.get_label(): line for line in figure.axes[2].get_lines()}
        drawn = lines["wanted clearance right"].get_ydata()
        side, metres = episode.trace.wanted.T
        assert np.array_equal(drawn, np.where(side == -1.0, metres, np.nan), equal_nan=True)
        assert np.isfinite(drawn).any()

    def test_all_that_is_written_is_on_the_page(self, driven: tuple) -> None:
        _, figure = driven
        width, height = figure.bbox.size
        legends = [ax.get_legend().get_window_extent() for ax in (figure.axes[1], figure.axes[3])]
        for box in [*legends, *boxes([t for ax in figure.axes for t in ax.texts if t.get_text()])]:
            assert box.x0 >= 0
            assert box.y0 >= 0
            assert box.x1 <= width
            assert box.y1 <= height


def test_many_states_and_transitions_are_all_named_without_a_word_off_the_page(driven: tuple) -> None:
    from dataclasses import replace

    from tral_fsm.runtime.machine import Transit

    episode, _ = driven
    n = len(episode.trace.states)
    names = [f"a state with a rather long name {k}" for k in range(24)]
    states = tuple(names[k * 24 // n] for k in range(n))
    transits = tuple((k * n // 80, Transit(0.0, (), 0, 1, f"a way {k}", "")) for k in range(80))
    crowded = replace(episode, trace=replace(episode.trace, states=states, transits=transits))
    figure = trajectory_figure(crowded, build_plan(generate("loop", np.random.default_rng(0))))
    assert words(figure.axes[1])[:24] == names
    assert words(figure.axes[3]) == [f"{k} a way {k - 1}" for k in range(1, 81)]
    boxes_of = [figure.axes[k].get_legend().get_window_extent() for k in (1, 3)]
    assert all(box.x0 >= 0 and box.y0 >= 0 and box.x1 <= figure.bbox.width for box in boxes_of)
    assert not boxes_of[0].overlaps(figure.axes[2].bbox)
