"""Search range of a parameter: ends and scale by its name, within the limits of the definition."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from annotated_types import Ge, Gt, Le, Lt

from tral_fsm.definition.validated import Spec


@dataclass(frozen=True)
class Span:
    """Search range: its ends and its scale."""

    low: float
    high: float
    log: bool = False
    """Whether the scale is logarithmic, as for gains and lengths, whose order of magnitude counts."""


SPANS = {
    "p": Span(0.2, 20.0, True),
    "i": Span(0.01, 2.0, True),
    "d": Span(0.05, 20.0, True),
    "speed": Span(0.3, 1.6),
    "slow_speed": Span(0.2, 1.0),
    "throttle": Span(0.12, 0.6),
    "clearance": Span(0.3, 1.2),
    "steering_trim": Span(-0.25, 0.25),
    "steering": Span(-1.0, 1.0),
    "max_error": Span(0.05, 1.0, True),
    "max_angle_deg": Span(5.0, 22.0),
    "max_rate": Span(0.1, 2.0, True),
    "ignore_jump": Span(0.01, 0.2, True),
    "slow_front": Span(0.6, 4.0),
    "length": Span(0.15, 1.5, True),
    "slope": Span(0.05, 0.8, True),
    "above": Span(0.3, 4.0),
    "below": Span(0.3, 4.0),
}
"""Ranges by name. Source: choice; a gain of 20 answers a step of the ultrasonic's jitter with a sixth of full lock."""
_FACTOR = 4.0
"""A parameter without a span has the range from a quarter of its value to four times it."""
_ABOVE = 1.0 + 1e-6


def limits(spec: type[Spec], name: str) -> tuple[float, float]:
    """Limits of a parameter in the definition; a limit that is itself excluded is moved by a millionth."""
    low, high = -math.inf, math.inf
    for limit in spec.model_fields[name].metadata:
        if isinstance(limit, Ge):
            low = float(limit.ge)  # type: ignore[arg-type]
        elif isinstance(limit, Gt):
            low = _past(float(limit.gt), 1.0)  # type: ignore[arg-type]
        elif isinstance(limit, Le):
            high = float(limit.le)  # type: ignore[arg-type]
        elif isinstance(limit, Lt):
            high = _past(float(limit.lt), -1.0)  # type: ignore[arg-type]
    return low, high


def _past(end: float, sign: float) -> float:
    return end + sign * max(abs(end), 1.0) * (_ABOVE - 1.0)


def span_of(spec: type[Spec], name: str, value: float) -> Span | None:
    """Search range of a parameter with this value; None: there is none for the value 0.

    The range comes from the spec's ``json_schema_extra={"tune": [low, high]}``, else from `SPANS`, else from the value.
    It is widened to hold the value, and narrowed to the limits of the definition.
    """
    ends = sorted((value / _FACTOR, value * _FACTOR))
    around = Span(ends[0], ends[1], log=value > 0.0)
    lowest, highest = limits(spec, name)
    for span in (_own_span(spec.model_fields[name].json_schema_extra), SPANS.get(name), around):
        if span is None:
            continue
        low, high = span.low, span.high
        if value > 0.0 or not span.log:  # 0 is not on a logarithmic scale
            low, high = min(low, value), max(high, value)
        low, high = max(low, lowest), min(high, highest)
        if low < high:  # else the definition allows no value of it
            return Span(low, high, span.log)
    return None


def _own_span(extra: Any) -> Span | None:
    ends = extra.get("tune") if isinstance(extra, dict) else None
    if ends is None:
        return None
    low, high = float(ends[0]), float(ends[1])
    return Span(low, high, log=low > 0.0 and high / low >= 10.0)
