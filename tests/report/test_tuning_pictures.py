"""Pictures of what is odd: nothing drawn may end a report that took hours to drive."""

from __future__ import annotations

import numpy as np
from courses import TWO_WALLS

from tral_fsm.report.tuning import model as tuning_model
from tral_fsm.report.tuning import plots
from tral_fsm.tuning.classical.design import Gains
from tral_fsm.tuning.classical.loops import Response
from tral_fsm.tuning.landscape import CostLine, CostPlane
from tral_fsm.tuning.parameters import find
from tral_fsm.tuning.search.optuna import OBJECTIVES
from tral_fsm.tuning.search.space import Trial

P, D, SPEED = find(TWO_WALLS, ["right.p", "right.d", "right.speed"])


def test_a_step_that_no_car_came_to_is_said() -> None:
    gains = Gains(p=1.2, d=1.5)
    none = Response(time=np.arange(4.0), clearance=np.full((2, 4), np.nan), step_m=0.15)
    drawn = tuning_model.steps({"was": (gains, 0.05, none)})
    labels = [text.get_text() for text in drawn.axes[0].get_legend().get_texts()]  # type: ignore[union-attr]
    assert labels[0] == "was: p = 1.2, d = 1.5 at 0.05 m/s; no car came to the step"


def test_a_cell_of_the_plane_that_no_machine_may_have_is_left_white() -> None:
    cost = np.array([[np.nan, 2.0], [3.0, 1.0]])
    failed = np.where(np.isnan(cost), np.nan, 0.0)
    xs, ys = np.array([1.0, 2.0]), np.array([0.5, 1.0])
    drawn = plots.plane(
        CostPlane(x=P, y=D, xs=xs, ys=ys, cost=cost, failed=failed, collided=failed), {"as it was": (1.0, 0.5)}
    )
    (mesh, *_) = drawn.axes[0].collections
    assert np.ma.getmaskarray(mesh.get_array()).ravel().tolist() == [True, False, False, False]
    assert mesh.get_clim() == (1.0, 3.0)


def test_a_parameter_that_does_not_matter_or_was_0_is_drawn_as_well() -> None:
    flat = [
        CostLine(parameter=each, values=np.array([0.5, 1.0]), cost=np.ones(2), failed=np.zeros(2))
        for each in (P, SPEED)
    ]
    drawn = plots.sensitivity(flat, [1.0, 1.0], [0.0, 0.7])
    drawn.canvas.draw()
    bottom, top = drawn.axes[0].get_ylim()
    assert bottom < 1.0 < top
    assert [len(ax.get_lines()) for ax in drawn.axes] == [3, 4]  # 0 has no place on a scale of factors


def test_ticks_of_less_than_a_decade_do_not_overlap() -> None:
    values = np.geomspace(0.5, 6.0, 9)
    line = CostLine(parameter=P, values=values, cost=np.linspace(1.0, 2.0, 9), failed=np.zeros(9))
    drawn = plots.sensitivity([line], [1.0], [1.2])
    drawn.canvas.draw()
    shown = [label.get_text() for label in drawn.axes[0].get_xticklabels(which="both")]
    assert shown == ["0.5", "0.931", "1.73", "3.22", "6"]


def test_the_front_says_in_what_it_is_not_beaten() -> None:
    one = Trial(values=(1.0,), cost=1.0, full=True, drives=1, successes=1, parts=(0.0, 0.0, 0.02, 1.0, 2.0))
    for objectives, said in (
        (("clearance", "time"), "clearance and time"),
        (OBJECTIVES, "clearance, time and steering"),
    ):
        drawn = plots.pareto([one], [one], one, None, objectives)
        labels = [text.get_text() for text in drawn.axes[0].get_legend().get_texts()]  # type: ignore[union-attr]
        assert labels == [f"not beaten in {said} together", "as it was"]


def test_the_legend_names_no_collisions_where_there_are_none() -> None:
    ends, calm = np.array([1.0, 2.0]), np.zeros((2, 2))
    for collided, shown in ((calm, []), (calm + 0.5, ["drives hit a wall"])):
        whole = CostPlane(x=P, y=D, xs=ends, ys=ends, cost=calm + 1.0, failed=collided, collided=collided)
        drawn = plots.plane(whole, {"tuned": (1.0, 1.0)})
        labels = [text.get_text() for text in drawn.axes[0].get_legend().get_texts()]  # type: ignore[union-attr]
        assert labels == [*shown, "tuned"]


def test_the_front_hides_no_candidate_behind_its_legend() -> None:
    one = Trial(values=(1.0,), cost=1.0, full=True, drives=1, successes=1, parts=(0.0, 0.0, 0.02, 1.0, 2.0))
    drawn = plots.pareto([one], [one], one, None, OBJECTIVES)
    drawn.canvas.draw()
    legend = drawn.axes[0].get_legend()
    assert legend is not None
    assert not legend.get_window_extent().overlaps(drawn.axes[0].patch.get_window_extent().padded(-2.0))


def test_the_search_names_only_what_happened() -> None:
    one = Trial(values=(1.0,), cost=1.0, full=True, drives=1, successes=1, parts=(0.0, 0.0, 0.02, 1.0, 2.0))
    drawn = plots.convergence([one], one)
    labels = [text.get_text() for text in drawn.axes[0].get_legend().get_texts()]  # type: ignore[union-attr]
    assert labels == ["all drives arrived", "best so far", "machine as it was"]
