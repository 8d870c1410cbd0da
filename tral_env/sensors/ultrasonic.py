"""Ultrasonic ranger: what a fan of rays hits -> the first echo -> what an SRF08 reads. Batched, without state.

Sensor frame: x along the boresight, y left. Every function takes any leading axes ("..."), so that several sensors of
several cars go through in one call: (3, n, R) is as good as (n, R). No sum depends on the shape of the batch, so a
row's result does not depend on the other rows by a single bit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from tral_env.arrays import Array, Flags, Values, is_any, maximum, minimum, negation, rint, spread, sqrt, where
from tral_env.config import UltrasonicConfig
from tral_env.interface import NO_ECHO_M

MEASURE_DRAWS = 4
"""`measure` takes so many uniform numbers for one reading."""

_NOTHING_M = 1e3
"""A ray that hit nothing is taken to end here, m: beyond any range, and finite so that no NaN arises."""


@dataclass(frozen=True, eq=False)
class _Fan:
    """The rays that sample a beam, in the sensor frame."""

    angle: Array
    """(R,) direction of each ray, rad, from right to left."""
    unit: Array
    """(2, R) cosine and sine of it."""
    cos_half_spacing: float
    """Cosine of half the angle between two rays."""
    edge_limit: Array
    """(R - 1,) an edge between two rays is heard no farther than this, m."""
    units: list[tuple[float, float]]
    """`unit` as R numbers."""
    edge_limits: list[float]
    """`edge_limit` as R - 1 numbers."""


class _Hit(NamedTuple):
    """What rays hit, in the sensor frame: values of any shape, or the numbers of a ray alone."""

    reach: Values
    """Distance along the ray, m; `_NOTHING_M` where nothing was hit."""
    x: Values
    """Place of the hit along the boresight, m."""
    y: Values
    """Place of the hit to the left, m."""
    nx: Values
    """Unit normal of the surface, along the boresight."""
    ny: Values
    """Unit normal of the surface, to the left."""
    height: Values
    """Perpendicular distance of the sensor from the plane of the surface, m: ``h = -n . p``."""


@lru_cache(maxsize=32)
def _fan(rays: int, beam_deg: float, edge_range: float) -> _Fan:
    """Lay the rays of a beam evenly, and work out how far an edge between two of them is heard.

    The lobe is taken as Gaussian in the angle a off the boresight: with h half the beam it lets through the amplitude
    ``2^-(a / h)^2``, 6 dB less at the rim, on the way out and again on the way in. The amplitude of an edge's echo
    falls with the square of its range r. So it reaches the threshold at ``r = edge_range 2^-(a / h)^2``: half the
    range at the rim.
    """
    angle = np.radians(np.linspace(-beam_deg / 2, beam_deg / 2, rays))
    half_spacing = math.radians(beam_deg / (rays - 1) / 2)
    off_axis = (angle[1:] + angle[:-1]) / math.radians(beam_deg)
    unit, edge_limit = np.stack([np.cos(angle), np.sin(angle)]), edge_range * 0.5**off_axis**2
    return _Fan(
        angle=angle,
        unit=unit,
        # The margin lets a foot exactly midway between two rays belong to either.
        cos_half_spacing=math.cos(half_spacing * 1.001),
        edge_limit=edge_limit,
        units=[(x, y) for x, y in unit.T.tolist()],
        edge_limits=edge_limit.tolist(),
    )


def ray_angles(config: UltrasonicConfig) -> Array:
    """Angles of the fan in the sensor frame, rad, (R,), from right to left."""
    return _fan(config.rays, config.beam_deg, config.edge_range).angle.copy()


def echo(distance: Array, normal: Array, config: UltrasonicConfig, softness: Array | None = None) -> Array:
    """Find the range of the first echo.

    A wave of 8.65 mm sees a smooth wall as a mirror. Three things send sound back to where it came from:

    - a wall, from the foot of the perpendicular: range = perpendicular distance h = -n . p, n the normal and p the
      point hit, whatever the car's heading, as long as the perpendicular leaves the boresight by at most
      `incidence_limit_deg` (era: 20 to 25) and its foot lies on the wall (the ray nearest to it hits that wall: h is at
      least the ray's length times the cosine of half a ray's spacing);
    - an inner corner of about 90 degrees, by two reflections: range = distance of the corner, anywhere in the beam;
    - an edge (outer corner, door frame, slim post), by diffraction: weak, heard to `edge_range` only, and to half of
      that at the rim of the beam. Its range is that of the nearer ray beside it: right to a ray's spacing.

    Sources: R. Kuc and M. W. Siegel, "Physically based simulation model for acoustic sensor robot navigation", IEEE
    PAMI 9(6), 1987 (planes, corners and edges as the three targets); beam, limit and wavelength see `UltrasonicConfig`.

    Args:
        distance: (..., R) along each ray of `ray_angles`, m; negative: nothing hit.
        normal: (..., R, 2) unit outward normal of the surface hit, sensor frame; finite where nothing was hit.
        config: the ranger.
        softness: (...) in [0, 1], places the incidence limit of this ranging within +-`incidence_spread_deg` of the
            limit; None: at the limit.

    Returns:
        (...) m; inf where no echo comes back within `max_range`.
    """
    fan = _fan(config.rays, config.beam_deg, config.edge_range)
    hit = _hit(distance, fan.unit, normal[..., 0], normal[..., 1])
    wall = np.minimum.reduce(_wall(hit, fan.cos_half_spacing, _cos_limit(config, softness)), axis=-1)
    right, left = _Hit(*(values[..., :-1] for values in hit)), _Hit(*(values[..., 1:] for values in hit))
    between = np.minimum.reduce(_corner_or_edge(right, left, fan.edge_limit, config), axis=-1)
    first = np.minimum(wall, between)
    result: Array = np.where(first <= config.max_range, first, np.inf)
    return result


def echo_alone(rays: Iterable[tuple[float, float, float]], config: UltrasonicConfig, softness: float) -> float:
    """As `echo`, for one ranger alone, ray by ray, and to the same last bit; a range of 0 may have another sign.

    Args:
        rays: R times the distance along a ray, m, and the normal of the surface that it hits, as `echo` has them.
        config: the ranger.
        softness: see `echo`.
    """
    fan, cos_limit = _fan(config.rays, config.beam_deg, config.edge_range), _cos_limit(config, softness)
    hits = [_hit(reach, unit, nx, ny) for (reach, nx, ny), unit in zip(rays, fan.units, strict=True)]
    first: float = min(_wall(hit, fan.cos_half_spacing, cos_limit) for hit in hits)
    for right, left, edge_limit in zip(hits, hits[1:], fan.edge_limits, strict=False):
        if not _is_one_wall(right, left, config):
            first = min(first, _corner_or_edge(right, left, edge_limit, config))
    return first if first <= config.max_range else math.inf


def _hit(distance: Values, unit: Any, nx: Values, ny: Values) -> _Hit:
    """What rays of a distance, m, hit; `unit` are the cosines and the sines of their directions."""
    reach = where(distance < 0, _NOTHING_M, distance)
    cos, sin = unit
    x, y = reach * cos, reach * sin
    return _Hit(reach, x, y, nx, ny, -(nx * x + ny * y))


def _wall(hit: _Hit, cos_half_spacing: float, cos_limit: Values) -> Values:
    """Ranges of the walls that rays hit, m; inf where the foot of the perpendicular is not there, or not heard."""
    mirror = (hit.height >= hit.reach * cos_half_spacing) & (-hit.nx >= cos_limit)
    return where(mirror, hit.height, math.inf)


def _cos_limit(config: UltrasonicConfig, softness: Values | None) -> Values:
    """Cosine of the greatest angle of incidence at which a wall is heard, (..., 1) or scalar."""
    limit, half = math.radians(config.incidence_limit_deg), math.radians(config.incidence_spread_deg)
    if softness is None:
        return math.cos(limit)
    # Linear in the cosine: no trigonometry per call, and within 0.15 degrees of linear in the angle.
    low, high = math.cos(limit - half), math.cos(limit + half)
    return spread(low + (high - low) * softness)


def _is_one_wall(p: _Hit, q: _Hit, config: UltrasonicConfig) -> bool:
    """Whether two rays of a ranger alone surely hit one wall, with neither a corner nor an edge between them."""
    same: bool = p.nx == q.nx and p.ny == q.ny and p.nx * q.nx + p.ny * q.ny > config.corner_tolerance
    # With one normal the heights differ by `front` of `_corner_or_edge`: half the step there leaves room for rounding.
    return same and bool(abs(p.height - q.height) < config.jitter_m / 8)


def _corner_or_edge(p: _Hit, q: _Hit, edge_limit: Values, config: UltrasonicConfig) -> Values:
    """Ranges of the inner corners and edges between neighbouring rays, m; inf where the surface runs on.

    The rays hit the points p and q on surfaces with the normals a and b. Point q lies ``a . (q - p)`` in front of the
    surface at p, and p lies ``b . (p - q)`` in front of the surface at q. Where one of them is behind the other's
    surface there is an edge between them; where neither is, and the surfaces stand across each other, there is an
    inner corner. Two planes at the heights u and v above the sensor, with the cosine c = a . b, meet at the distance
    ``sqrt((u^2 + v^2 - 2 u v c) / (1 - c^2))``.
    """
    dx, dy = q.x - p.x, q.y - p.y
    front = minimum(p.nx * dx + p.ny * dy, -(q.nx * dx + q.ny * dy))
    edge = front < -config.jitter_m / 4  # a quarter of a wavelength: less is no step to the wave
    near = minimum(q.reach, p.reach)
    found = where(edge & (near <= edge_limit), near, math.inf)
    cosine = p.nx * q.nx + p.ny * q.ny
    # A ray that ends in the corner itself lies on both surfaces, in front of neither.
    inner = (abs(cosine) <= config.corner_tolerance) & negation(edge) & (maximum(q.reach, p.reach) < _NOTHING_M)
    if not is_any(inner):
        return found
    u, v, c = p.height, q.height, where(inner, cosine, 0.0)
    return where(inner, sqrt((u * u + v * v - 2 * u * v * c) / (1 - c * c)), found)


def measure(
    first: Values, uniform: Array | list[float], config: UltrasonicConfig, outlier_rate: Values = 0.0
) -> Values:
    """Read a first echo as the ranger does.

    - Jitter: the comparator fires on one wave front too early or too late, each with probability `jitter_share` / 2
      (choice; only the step of 8.65 mm has been measured). Standard deviation 8.65 mm * sqrt(jitter_share) = 4.7 mm.
    - Outliers, with probability `outlier_rate`: half of them lose the echo, three in ten read a false echo anywhere
      short of the true one, two in ten read the second echo, at twice the range (shares: choice).
    - Nothing nearer than `min_range` or farther than `max_range`; in centimetre mode 0.2 to 3 m (report).
    - Resolution 1 us = 0.17 mm, or 1 cm in centimetre mode, rounded.

    Args:
        first: (...) first echo, m; inf: none.
        uniform: (..., 4) numbers in [0, 1): wave front, outlier, its kind, its range; a list for a sonar alone.
        config: the ranger.
        outlier_rate: (...) or scalar, probability of an outlier.

    Returns:
        (...) m, `NO_ECHO_M` where there is no echo.
    """
    low, high = limits(config)
    front, strange, kind, place = uniform if isinstance(uniform, list) else np.moveaxis(uniform, -1, 0)
    early = front < config.jitter_share / 2
    late = front >= 1 - config.jitter_share / 2
    range_m = first + config.jitter_m * (late * 1.0 - early)
    outlier = strange < outlier_rate
    if is_any(outlier):
        short = low + (minimum(first, high) - low) * place
        wrong = where(kind < 0.5, math.inf, where(kind < 0.8, short, 2 * first))
        range_m = where(outlier, wrong, range_m)
    heard, unit = readable(range_m, config), resolution(config)
    return where(heard, rint(where(heard, range_m, 0.0) / unit) * unit, NO_ECHO_M)


def limits(config: UltrasonicConfig) -> tuple[float, float]:
    """Shortest and longest range of the mode in use, m."""
    if config.mode == "cm":
        return max(config.min_range, config.cm_min_range), min(config.max_range, config.cm_max_range)
    return config.min_range, config.max_range


def resolution(config: UltrasonicConfig) -> float:
    """Range that one unit of the register stands for, m: a microsecond of flight there and back, or a centimetre."""
    return 0.01 if config.mode == "cm" else config.metres_per_us


def readable(range_m: Array | float, config: UltrasonicConfig) -> Flags:
    """Whether ranges of any shape, m, lie within the limits of the mode in use; beyond them there is no echo."""
    low, high = limits(config)
    result: Flags = (range_m >= low) & (range_m <= high)  # type: ignore[assignment]
    return result


def crosstalk(first: Array, uniform: Array, together: Flags, config: UltrasonicConfig) -> Array:
    """Let sonars that fire together hear each other.

    The front sonar and a side sonar share a quarter of the surroundings. Sound of one comes back to the other by the
    way out of the one and the way in of the other, ranges r and s, and is read as ``(r + s) / 2``. So the farther of
    the two reads short. The two side sonars look away from each other and hear nothing of each other. How often it
    happens (`crosstalk_share`) is a choice: the broadcast command that fires all three is documented, its crosstalk is
    not measured.

    Args:
        first: (3, ...) first echoes of left, front, right, m; inf: none.
        uniform: (3, ...) numbers in [0, 1).
        together: (...) whether that car's sonars fire together.
        config: the rangers.

    Returns:
        (3, ...) first echoes, never later than they were.
    """
    left, front, right = first[0], first[1], first[2]
    side = np.minimum(left, right)
    heard = np.stack([(left + front) / 2, (front + side) / 2, (right + front) / 2])
    return np.where(together & (uniform < config.crosstalk_share), np.minimum(first, heard), first)
