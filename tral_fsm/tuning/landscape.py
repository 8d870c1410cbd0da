"""Cost around a machine as data: over a plane of two parameters, and along each parameter alone."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tral_fsm.tuning.parameters import Parameter

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class CostPlane:
    """Cost over two parameters; the others have the values of the result."""

    x: Parameter
    y: Parameter
    xs: Array
    """(nx,) values of x."""
    ys: Array
    """(ny,) values of y."""
    cost: Array
    """(ny, nx) cost; it and the two fields below are NaN where the definition allows no such machine."""
    failed: Array
    """(ny, nx) share of drives that did not arrive."""
    collided: Array
    """(ny, nx) share of drives that ended at a wall."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CostLine:
    """Cost along one parameter; the others have the values of the result."""

    parameter: Parameter
    values: Array
    """(n,) values of the parameter."""
    cost: Array
    """(n,) cost at each value; NaN where the definition allows no such machine."""
    failed: Array
    """(n,) share of drives that did not arrive."""


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """Cost around a machine."""

    plane: CostPlane | None
    """Plane of the first two real parameters; None: there are fewer."""
    lines: list[CostLine]
    courses: int
    """Number of courses that each point has driven."""
    landmarks: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Classical gains in the plane: name -> (x, y)."""
