"""Options of drivers: fields with a unit and bounds, told once; the standard library alone."""

from __future__ import annotations

import math
from dataclasses import MISSING, field, fields
from typing import Any

from tral_env.errors import ConfigError


def quantity(default: Any, low: float, high: float, unit: str = "", *, optional: bool = False) -> Any:
    """A field that holds a number.

    Args:
        default: value if none is given; `MISSING`: it has to be given.
        low: least value.
        high: greatest value.
        unit: of all three.
        optional: whether None is allowed, too.
    """
    bounds = {"low": low, "high": high, "unit": unit, "optional": optional}
    return field(metadata=bounds) if default is MISSING else field(default=default, metadata=bounds)


def check_quantities(options: Any) -> None:
    """Refuse numbers beyond the bounds of their fields, and what is no number.

    Raises:
        ConfigError: a value is not allowed.
    """
    for each in fields(options):
        if "low" not in each.metadata:
            continue
        value = getattr(options, each.name)
        if (value is None and each.metadata["optional"]) or (isinstance(value, str) and "str" in str(each.type)):
            continue  # a bus is a number or a path
        low, high, unit = (each.metadata[name] for name in ("low", "high", "unit"))
        is_number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if not is_number or not low <= value <= high:
            where = f"{type(options).__name__}.{each.name}"
            raise ConfigError(f"{where} = {value!r}: expected {low:g} to {high:g}{f' {unit}' if unit else ''}")
