"""`tral tune --classical`: margins of a machine's own gains, of LQR gains, and of gains from a relay experiment."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tral_fsm.evaluation.results import print_figures

if TYPE_CHECKING:
    from rich.table import Table

    from tral_fsm.definition.machine import MachineDefinition
    from tral_fsm.tuning.classical.loops import WallGains

_SPEEDS = (0.3, 0.5, 0.7, 1.0, 1.3, 1.6, 2.0)


def print_classical(machine: MachineDefinition) -> None:
    """Print the gains of a machine and classical gains, with their margins."""
    from tral_fsm.tuning.classical.design import lqr
    from tral_fsm.tuning.classical.experiments import relay, wall_gains
    from tral_fsm.tuning.classical.loops import WallGains

    states = wall_gains(machine)
    if states:
        print_figures(_table("Its own gains", states))
    scheduled = [WallGains(name=f"LQR at {speed:g} m/s", gains=lqr(speed), speed=speed) for speed in _SPEEDS]
    print_figures(_table("LQR with kp = 1 rad/m, by speed", scheduled))
    found = []
    for speed in sorted({0.5, *(state.speed for state in states)}):
        swing = relay(speed)
        if swing is not None:
            name = f"Ku = {swing.ultimate_gain:.3g} 1/m, Tu = {swing.period_s:.2f} s"
            found.append(WallGains(name=name, gains=swing.ziegler_nichols(), speed=speed))
    if found:
        print_figures(_table("Relay experiment and Ziegler-Nichols", found))


def _table(title: str, states: list[WallGains]) -> Table:
    from rich.table import Table
    from rich.text import Text

    from tral_fsm.tuning.tables import MARGIN_HEADER, margin_cells

    table = Table(title=Text(title), title_justify="left")
    for heading in MARGIN_HEADER:
        table.add_column(Text(heading), justify="left" if heading == "gains" else "right", no_wrap=True)
    for state in states:
        table.add_row(*(Text(cell) for cell in margin_cells(state)))
    return table
