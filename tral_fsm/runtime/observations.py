"""Whether an observation is one: a machine that is driven by something else drives on nonsense."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.errors import ConfigError
from tral_env.interface import CORE_FIELDS, OPTIONAL_GROUPS

WIDTH = len(CORE_FIELDS)
"""A machine looks at so many columns."""
_MAX_WIDTH = WIDTH + sum(map(len, OPTIONAL_GROUPS.values()))
_LOW = np.array([field.low for field in CORE_FIELDS], np.float32)
_HIGH = np.array([field.high for field in CORE_FIELDS], np.float32)
_LOWS, _HIGHS = _LOW.tolist(), _HIGH.tolist()
_UNTOUCHED = "a machine takes the readings as the environment gives them"


def checked_rows(observation: Any, n: int) -> list[list[float]]:
    """The readings of n cars, if they are readings.

    Args:
        observation: (d,) for one car or (n, d), in the columns of `tral_env.interface.Layout`.
        n: number of cars.

    Returns:
        n rows of `WIDTH` readings.

    Raises:
        ConfigError: the observation is no array, has another shape, or a value is NaN or out of bounds.
    """
    rows = as_array(observation)
    rows = rows[None] if rows.ndim == 1 else rows
    if rows.ndim != 2 or len(rows) != n or not WIDTH <= rows.shape[1] <= _MAX_WIDTH:
        raise ConfigError(_wrong_shape(observation, n))
    if n == 1:  # NumPy takes longer for one row than Python
        row = rows[0, :WIDTH].tolist()
        if not _is_within(row):
            raise ConfigError(_out_of_bounds(rows[:, :WIDTH]))
        return [row]
    rows = rows[:, :WIDTH]
    if not ((rows >= _LOW) & (rows <= _HIGH)).all():  # NaN is in no order
        raise ConfigError(_out_of_bounds(rows))
    return rows.tolist()  # type: ignore[no-any-return]


def _is_within(row: list[float]) -> bool:
    for low, value, high in zip(_LOWS, row, _HIGHS, strict=True):  # noqa: SIM110 - all(...) would cost a generator
        if not low <= value <= high:
            return False
    return True


def as_array(observation: Any) -> NDArray[np.floating]:
    """The observation itself, if it is an array.

    Raises:
        ConfigError: it is none.
    """
    if isinstance(observation, np.ndarray):
        return observation
    got = f"observation is a {type(observation).__name__}"
    if isinstance(observation, Mapping):
        inside = ", ".join(map(str, observation))
        raise ConfigError(
            f"{got} with {inside}: {_UNTOUCHED}; of TralCorridorPixels-v0 hand over observation['readings']"
        )
    if isinstance(observation, tuple):
        raise ConfigError(f"{got}: reset() of an environment gives (observation, info); hand over the first")
    raise ConfigError(f"{got}, expected a NumPy array; np.asarray(...) may make one")


def _wrong_shape(observation: NDArray[Any], n: int) -> str:
    shape = observation.shape
    got = f"observation has shape {shape}, expected ({n}, {WIDTH} or more): "
    if len(shape) > 2:
        return f"{got}{_UNTOUCHED}; is it an image, or has a wrapper stacked frames?"
    if shape[-1:] and shape[-1] > _MAX_WIDTH:
        return f"{got}at most {_MAX_WIDTH} with all optional groups; has a wrapper stacked frames or added columns?"
    if len(shape) == 2 and shape[1] >= WIDTH:
        return f"{got}call reset(n) with the number of cars first"
    return f"{got}the fields of tral_env.interface.CORE_LAYOUT, and a row for each car of reset(n)"


def _out_of_bounds(rows: NDArray[np.floating]) -> str:
    row, column = np.argwhere(~((rows >= _LOW) & (rows <= _HIGH)))[0].tolist()
    field, value = CORE_FIELDS[column], float(rows[row, column])
    unit = f" {field.unit}" if field.unit else ""
    got = f"observation: {field.name} = {value:g}{unit} in row {row}, allowed {field.low:g} to {field.high:g}{unit}: "
    if np.isnan(value):
        return f"{got}nothing seen is {field.missing:g}; look for the sensor or wrapper that gives NaN"
    return (
        f"{got}{_UNTOUCHED}, in SI units. Were they normalized or rescaled? Hand over those before it, such as "
        "VecNormalize.get_original_obs(), or drive without that wrapper"
    )
