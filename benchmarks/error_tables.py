"""Tables of errors that the benchmarks of perception print: medians beside 95 % quantiles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

Array = NDArray[np.float64]


def quantiles(values: Array) -> list[float] | None:
    """Median and 95 % quantile; None without values."""
    return [round(float(np.quantile(values, share)), 3) for share in (0.5, 0.95)] if len(values) else None


def show(console: Console, title: str, rows: list[dict[str, Any]]) -> None:
    """Print rows as a table; a pair is a median and a 95 % quantile."""
    flat = [_flat(row) for row in rows]
    table = Table(title=title)
    for name in flat[0]:
        table.add_column(name, justify="right")
    for row in flat:
        table.add_row(*(_cell(value) for value in row.values()))
    console.print(table)


def _flat(row: dict[str, Any]) -> dict[str, Any]:
    """A row in which each entry of an inner mapping has a column."""
    out: dict[str, Any] = {}
    for name, value in row.items():
        inner = {f"{name} {k}": v for k, v in value.items()} if isinstance(value, dict) else {name: value}
        out.update(inner)
    return out


def _cell(value: Any) -> str:
    if isinstance(value, list):
        return " / ".join("-" if part is None else f"{part:.4g}" for part in value)
    return "-" if value is None else value if isinstance(value, str) else f"{value:g}"
