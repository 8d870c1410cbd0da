"""Checks of the numbers and names that people give: what no car has is refused, and the likely unit is asked for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import fields
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeGuard, TypeVar

import numpy as np

from tral_env.errors import ConfigError, TralError, nearest

Config = TypeVar("Config")

_OTHER_UNITS: Mapping[str, Mapping[str, float]] = {
    "m": {"mm": 1e3, "cm": 1e2},
    "m/s": {"mm/s": 1e3, "km/h": 3.6},
    "s": {"ms": 1e3, "us": 1e6},
    "V": {"mV": 1e3},
    "ohm": {"milliohm": 1e3},
    "kg": {"g": 1e3},
    "deg": {"rad": math.pi / 180.0},
    "rad/s": {"deg/s": 180.0 / math.pi},
    "N m": {"N mm": 1e3},
    "": {"%": 1e2},
}
"""Unit -> units that a number may have been given in by mistake: how many of those make one of it."""


def check_plausible(where: str, value: float, low: float, high: float, unit: str) -> None:
    """Refuse a number that no car has, and ask for the unit in which it would be one.

    Args:
        where: name of the number.
        value: what was given.
        low: least plausible value.
        high: greatest plausible value.
        unit: of all three.

    Raises:
        ConfigError: the number is below `low` or above `high`.
    """
    if low <= value <= high:
        return
    likely = [name for name, count in _OTHER_UNITS.get(unit, {}).items() if low <= value / count <= high]
    hint = f"; is it in {' or '.join(likely)}?" if likely else ""
    with_unit = f" {unit}" if unit else ""
    raise ConfigError(f"{where} = {value:g}{with_unit}: expected {low:g} to {high:g}{with_unit}{hint}")


Bounds = Mapping[str, tuple[float, float, str]]
"""Name of a field -> least and greatest plausible value, unit. Source of all bounds: choice, beyond any small car."""


def is_number(value: object, *, whole: bool = False) -> TypeGuard[float]:
    """Whether a value is a finite number, of Python or NumPy; text, `None`, `True` and `False` are none.

    Args:
        value: the value.
        whole: whether it has to be of a type of whole numbers.
    """
    if isinstance(value, bool | np.bool_) or not isinstance(value, Integral if whole else Real):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number that no float can hold
        return False


def is_seed(value: object) -> bool:
    """Whether a value can seed an episode: `None`, or a whole number, 0 or more; `True` is none."""
    return value is None or (is_number(value, whole=True) and bool(value >= 0))


def check_number(where: str, value: object, unit: str = "", *, whole: bool = False) -> None:
    """Refuse what is no finite number; text, `None`, `True` and `False` are none.

    Args:
        where: name of the number.
        value: what was given.
        unit: that the number should have, for the error.
        whole: whether a fraction is refused too.

    Raises:
        ConfigError: no finite number, or a fraction.
    """
    if not is_number(value, whole=whole):
        expected = "a whole number" if whole else "a finite number"
        raise ConfigError(f"{where} = {value!r}: expected {expected}{f' of {unit}' if unit else ''}")


def check_rows(what: str, rows: Any, n: int, failure: type[TralError] = ConfigError) -> None:
    """Refuse what is not one truth value for each car.

    Args:
        what: what the values choose, for the error.
        rows: (n,) bool.
        n: number of cars.
        failure: class of the error.

    Raises:
        failure: another shape, or no truth values.
    """
    if np.shape(rows) != (n,) or np.asarray(rows).dtype != np.bool_:
        got = f"{np.asarray(rows).dtype} of shape {np.shape(rows)}"
        raise failure(f"{what}: got {got}, expected bool of shape ({n},)")


def one_of(name: str, value: object, allowed: Iterable[str], hint: str = "") -> None:
    """Refuse what is none of some names; a list of names, too, is none.

    Args:
        name: what is chosen.
        value: what was given.
        allowed: the names.
        hint: end of the error.

    Raises:
        ConfigError: none of the names; the error tells the nearest.
    """
    names = tuple(allowed)
    if not isinstance(value, str) or value not in names:
        got = f"'{value}'" if isinstance(value, str | Path) else repr(value)
        raise ConfigError(f"unknown {name} {got}: {nearest(value, names)}{hint}")


def check_fields(
    config: object,
    positive: tuple[str, ...] = (),
    unit_interval: tuple[str, ...] = (),
    plausible: Bounds | None = None,
) -> None:
    """Check the fields of a dataclass whose defaults are numbers.

    Args:
        config: the dataclass.
        positive: fields that have to be above 0.
        unit_interval: fields that have to be shares, 0 to 1.
        plausible: fields with bounds.

    Raises:
        ConfigError: a field is no number, or is not allowed.
    """
    plausible = plausible or {}
    for field in fields(config):  # type: ignore[arg-type]
        if not isinstance(field.default, int | float):
            continue
        value = getattr(config, field.name)
        where = f"{type(config).__name__}.{field.name}"
        bounds = plausible.get(field.name)
        check_number(where, value, bounds[2] if bounds else "", whole=isinstance(field.default, int))
        if field.name in positive and not value > 0:
            raise ConfigError(f"{where} = {value!r}: expected a number above 0")
        if field.name in unit_interval and not 0 <= value <= 1:
            percent = "; is it in %?" if 1 < value <= 100 else ""
            raise ConfigError(f"{where} = {value!r}: expected a share between 0 and 1{percent}")
        if bounds:
            check_plausible(where, value, *bounds)


def as_config(kind: type[Config], value: Config | Mapping[str, Any] | None) -> Config:
    """A configuration: the default one for None; one of the named values for a mapping.

    A mapping is what `EnvSpec.from_json` gives for a configuration that went through `to_json`.

    Raises:
        ConfigError: unknown name, or neither of these.
    """
    if value is None:
        return kind()
    if isinstance(value, kind):
        return value
    if not isinstance(value, Mapping):
        raise ConfigError(f"got {value!r}: expected a {kind.__name__}, or a mapping of its values")
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    for name in value:
        if name not in names:
            raise ConfigError(f"{kind.__name__} has no '{name}': {nearest(name, names)}")
    return kind(**{name: tuple(item) if isinstance(item, list) else item for name, item in value.items()})
