"""Cells of the tables of a search, the same on the terminal and on the HTML page."""

from __future__ import annotations

from tral_fsm.evaluation.statistics import Estimate
from tral_fsm.tuning.classical.design import margins
from tral_fsm.tuning.classical.loops import WallGains
from tral_fsm.tuning.holdout import Change, Comparison, Paired
from tral_fsm.tuning.parameters import Parameter

MARGIN_HEADER = (
    "gains", "speed [m/s]", "p [1/m]", "d [s/m]", "phase margin [deg]", "gain margin", "delay margin [ms]", "damping",
)  # fmt: skip
"""Headings of `margin_cells`."""


def margin_cells(state: WallGains) -> list[str]:
    """Name, speed, gains and margins of a state, a cell for each heading of `MARGIN_HEADER`."""
    found = margins(state.gains, state.speed)
    return [
        state.name, f"{state.speed:.3g}", f"{state.gains.p:.3g}", f"{state.gains.d:.3g}", f"{found.phase_deg:.0f}",
        f"{found.gain:.2g}", f"{1000.0 * found.delay_s:.0f}", f"{found.damping:.2f}",
    ]  # fmt: skip


def estimate_cell(value: Estimate, scale: float = 1.0, digits: int = 2, sign: str = "") -> str:
    """A figure with its interval, such as ``1.20 (1.05 to 1.41)``; ``-`` where nothing was measured."""
    if value.value is None:
        return "-"
    text = f"{scale * value.value:{sign}.{digits}f}"
    if value.low is None or value.high is None:
        return text
    return f"{text} ({scale * value.low:{sign}.{digits}f} to {scale * value.high:{sign}.{digits}f})"


CHECK_HEADER = ("", "was", "now", "now - was", "")
"""Headings of `check_rows`."""


def check_rows(found: Comparison) -> list[list[str]]:
    """Rows of the check on hold-out courses, a cell for each heading of `CHECK_HEADER`.

    Each part of the cost has a row of its own, so that it can be seen which of them paid.
    """
    old, new = found.collisions
    split = f"{found.only_new} gained, {found.only_old} lost, p = {found.sign_p:.2g}"
    success = _check_row(found, "success [%]", found.success, 100.0, 0)
    success[3] = f"{100.0 * (found.success.difference.value or 0.0):+.0f} ({split})"
    return [
        success,
        ["collisions", str(old), str(new), f"{new - old:+d}", ""],
        _check_row(found, "clearance RMSE [cm]", found.clearance_rmse_m, 100.0),
        _check_row(found, "settled RMSE [cm]", found.settled_rmse_m, 100.0),
        _check_row(found, "time [s/m]", found.time_per_m, 1.0, 3),
        _check_row(found, "steering [1/m]", found.steering_per_m),
        _check_row(found, "cost", found.cost, 1.0, 3),
        *(_check_row(found, f"- {name}", figure, 1.0, 3) for name, figure in found.cost_parts.items()),
    ]


def _check_row(found: Comparison, name: str, figure: Paired, scale: float = 1.0, digits: int = 2) -> list[str]:
    change = figure.change
    cells = [estimate_cell(each, scale, digits) for each in (figure.old, figure.new)]
    difference = estimate_cell(figure.difference, scale, digits, "+")
    return [name, *cells, difference, "" if change is Change.NOISE else change.value]


def before_cell(parameter: Parameter) -> str:
    """Old value of a parameter; if several places share it, each different value once."""
    return ", ".join(dict.fromkeys(value_cell(site.value) for site in parameter.sites))


def value_cell(value: object) -> str:
    """A value of a parameter with four digits."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def range_cell(parameter: Parameter) -> str:
    """The range or the choices in which a parameter was searched."""
    if parameter.kind == "choice":
        return ", ".join(str(each) for each in parameter.choices)
    return f"{parameter.low:.4g} to {parameter.high:.4g}{', by factors' if parameter.log else ''}"
