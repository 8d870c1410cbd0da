"""`tral tune --classical`: margins of a machine's own gains, of LQR gains, and of gains from a relay experiment."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import typer

from tral_fsm.terminal import narrow_table, print_figures

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rich.table import Table

    from tral_fsm.definition.machine import MachineDefinition
    from tral_fsm.tuning.classical.loops import WallGains

_SPEEDS = (0.3, 0.5, 0.7, 1.0, 1.3, 1.6, 2.0)
_TITLES = {
    "own": "Its own gains",
    "lqr": "LQR with kp = 1 rad/m, by speed",
    "relay": "Relay experiment and Ziegler-Nichols",
}
"""Kind of gains -> title of their table."""


def show_classical(machine: MachineDefinition, *, as_json: bool) -> None:
    """Print the gains of a machine and classical gains, with their margins.

    Args:
        machine: the machine.
        as_json: print one JSON object instead of tables: kind of gains -> list of records.
    """
    found = classical(machine)
    if as_json:
        records = {kind: [_record(state) for state in states] for kind, states in found.items()}
        typer.echo(json.dumps(records, indent=2, allow_nan=False))
        return
    for kind, states in found.items():
        if states:
            print_figures(_table(_TITLES[kind], states))


def classical(machine: MachineDefinition) -> dict[str, list[WallGains]]:
    """Gains by kind: "own" of the machine, "lqr" by speed, "relay" at the speeds at which there is a limit cycle."""
    from tral_fsm.tuning.classical.design import lqr
    from tral_fsm.tuning.classical.experiments import relay, wall_gains
    from tral_fsm.tuning.classical.loops import WallGains

    states = wall_gains(machine)
    scheduled = [WallGains(name=f"LQR at {speed:g} m/s", gains=lqr(speed), speed=speed) for speed in _SPEEDS]
    found = []
    for speed in sorted({0.5, *(state.speed for state in states)}):
        swing = relay(speed)
        if swing is not None:
            name = f"Ku = {swing.ultimate_gain:.3g} 1/m, Tu = {swing.period_s:.2f} s"
            found.append(WallGains(name=name, gains=swing.ziegler_nichols(), speed=speed))
    return {"own": states, "lqr": scheduled, "relay": found}


def _record(state: WallGains) -> dict[str, Any]:
    """Gains and margins as plain values; an infinite margin is None."""
    from tral_fsm.tuning.classical.design import margins

    numbers: Mapping[str, float] = asdict(margins(state.gains, state.speed))
    plain = {name: value if math.isfinite(value) else None for name, value in numbers.items()}
    return {"name": state.name, **asdict(state.gains), **plain}


def _table(title: str, states: Sequence[WallGains]) -> Table:
    from rich.text import Text

    from tral_fsm.tuning.tables import MARGIN_HEADER, margin_cells

    table = narrow_table(title)
    for heading in MARGIN_HEADER:
        table.add_column(
            Text(heading.replace(" ", "\n")), justify="left" if heading == "gains" else "right", no_wrap=True
        )
    for state in states:
        table.add_row(*(Text(cell) for cell in margin_cells(state)))
    return table
