"""Names of the arrays that pass between rooms, and how a law is written once for many cars and for one.

A law takes arrays with a row for each car. For a car alone it takes plain numbers instead, with which Python computes
ten times as fast as NumPy with arrays of one, and to the same last bit: a law that is called so uses `where`,
`minimum`, `maximum`, `sqrt`, `floor` and `rint` of this module beside + - * / and comparisons, and functions of NumPy
for all that is rounded otherwise by `math`. It squares x as x * x, because Python and NumPy round powers differently.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers."""
Index = NDArray[np.int64]
"""Rows, ids or counts."""
Flags = NDArray[np.bool_]
"""Yes or no."""
Image = NDArray[np.uint8]
"""Pixels."""

Values = Any
"""Values (k,) of some cars, or the number of a car alone."""
Rows = Index | slice | int
"""Some cars: their numbers, `ALL`, or `ALONE`."""
ALL = slice(None)
"""All cars."""
ALONE = 0
"""The only car there is; its values are numbers."""


def everyone(n: int) -> slice | int:
    """All of n cars."""
    return ALONE if n == 1 else ALL


def pick(values: Any, rows: Rows) -> Any:
    """The values (k,) of some cars out of (n,), not to be written to; the number of a car alone.

    What is a number already stays one, for all cars alike.
    """
    kind = type(values)
    if kind is np.ndarray:
        return values if rows is ALL else values.item(0) if rows is ALONE else values[rows]
    if rows is ALL or kind is float or kind is bool:
        return values
    return values.item() if rows is ALONE and isinstance(values, np.generic) else values


def columns(values: Any, rows: Rows) -> Any:
    """The m columns (k,) of some cars out of (n, m), not to be written to; m numbers of a car alone."""
    if rows is ALL:
        return values.T
    return values[rows].tolist() if rows is ALONE else values[rows].T


def plain(values: Any) -> Any:
    """What a function of NumPy gave: an array, or a number that Python computes with faster than with NumPy's own."""
    return values if type(values) is np.ndarray else values.item()


def negation(condition: Any) -> Any:
    """`numpy.logical_not`, also for a bool."""
    return not condition if type(condition) is bool else ~condition


def number(values: Any) -> Any:
    """The number of a car alone, also out of (1,)."""
    return values.item(0) if type(values) is np.ndarray else values


def as_rows(values: Any) -> Any:
    """Values (n,) again, from those or from the number of a car alone."""
    return values if isinstance(values, np.ndarray) else np.array([values])


def spread(values: Any) -> Any:
    """Values (k,) as (k, 1), beside arrays (k, m); a number stays one, beside (m,)."""
    return values[:, None] if isinstance(values, np.ndarray) else values


def where(condition: Any, yes: Any, no: Any) -> Any:
    """`numpy.where`, also for a bool."""
    if type(condition) is bool:
        return yes if condition else no
    return np.where(condition, yes, no)


def minimum(a: Any, b: Any) -> Any:
    """`numpy.minimum`, also for two numbers, neither of them NaN."""
    if type(a) is type(b) is float:
        return a if a < b else b
    return np.minimum(a, b)


def maximum(a: Any, b: Any) -> Any:
    """`numpy.maximum`, also for two numbers, neither of them NaN."""
    if type(a) is type(b) is float:
        return a if a > b else b
    return np.maximum(a, b)


def sqrt(values: Any) -> Any:
    """`numpy.sqrt`, also of a number: both round to the nearest float."""
    return math.sqrt(values) if type(values) is float else np.sqrt(values)


def square(values: Any) -> Any:
    """`numpy.square`, also of a number, whose power Python rounds otherwise."""
    return values * values


def floor(values: Any) -> Any:
    """`numpy.floor`, also of a finite number."""
    return values // 1.0 if type(values) is float else np.floor(values)


def rint(values: Any) -> Any:
    """`numpy.rint`, also of a finite number: both round a half to the even neighbour."""
    return math.copysign(round(values), values) if type(values) is float else np.rint(values)


def largest(values: Any) -> Any:
    """`numpy.max`, also of the number of a car alone."""
    return values.max() if type(values) is np.ndarray else values


def is_any(condition: Any) -> bool:
    """Whether a condition holds for any car; it is a bool for a car alone."""
    return condition if type(condition) is bool else bool(condition.any())
