from __future__ import annotations

from pathlib import Path

import pytest
from test_summary import record

from tral_env.errors import ConfigError
from tral_fsm import load_machine
from tral_fsm.definition import MachineDefinition, StopSpec
from tral_fsm.report.heatmap import label, sweep_figure
from tral_fsm.report.summary import summarize
from tral_fsm.tune import Cell, best, gains, with_gains


def cell(p: float, d: float, rmse: float, successes: int = 2) -> Cell:
    outcomes = ["success"] * successes + ["collision"] * (2 - successes)
    rows = [record(outcome, clearance_rmse_m=rmse, clearance_samples=10) for outcome in outcomes]
    return Cell(p=p, d=d, summary=summarize(rows))


def test_the_gains_of_a_machine_are_those_of_its_wall_following_states() -> None:
    changed = with_gains(load_machine("wall"), 3.5, 0.25)
    assert gains(changed) == (3.5, 0.25)
    assert gains(load_machine("wall")) != (3.5, 0.25)


def test_nothing_but_the_gains_is_changed() -> None:
    machine = load_machine("wall")
    assert with_gains(machine, *gains(machine)) == machine


def test_a_machine_without_a_wall_to_follow_has_no_gains() -> None:
    machine = MachineDefinition(root=0, name="rest", states=(StopSpec(id=0),))
    with pytest.raises(ConfigError, match="machine 'rest' has no state that follows a wall"):
        gains(machine)


def test_a_gain_out_of_its_range_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"p = -1, d = 0 cannot be used: p: .* greater than or equal to 0"):
        with_gains(load_machine("wall"), -1.0, 0.0)


def test_the_best_pair_arrives_most_often_and_errs_least_among_those() -> None:
    cells = [cell(1, 0, 0.01, successes=1), cell(2, 0, 0.05), cell(3, 0, 0.04)]
    assert best(cells).p == 3


def test_a_cell_says_its_error_and_how_many_failed() -> None:
    assert label(cell(1, 0, 0.034)) == "3.4"
    assert label(cell(1, 0, 0.034, successes=1)) == "3.4\n1/2 ok"
    assert label(Cell(p=1, d=0, summary=summarize([record()]))) == "-"


def test_the_heat_map_shows_every_pair(tmp_path: Path) -> None:
    figure = sweep_figure([cell(p, d, 0.01 * (p + d)) for p in (1, 2, 4) for d in (0, 1)], "a sweep")
    ax = figure.axes[0]
    assert [text.get_text() for text in ax.texts] == ["1.0", "2.0", "2.0", "3.0", "4.0", "5.0"]
    assert [text.get_text() for text in ax.get_yticklabels()] == ["1", "2", "4"]
