"""Ranges, speed, steering and clearance error over the last 20 s."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
import viser
from numpy.typing import NDArray
from viser import uplot

from tral_env.interface import NO_ECHO_M
from tral_fsm.live.frame import CarFrame

SPAN_S = 20.0
EVERY_S = 0.1
"""Points are so far apart."""
_LEFT, _FRONT, _RIGHT, _GREY = "#1b7f3b", "#b3261e", "#0b5cad", "#9aa0a6"
CHARTS: dict[str, tuple[tuple[str, str], ...]] = {
    "ultrasonics, m": (("left", _LEFT), ("front", _FRONT), ("right", _RIGHT)),
    "speed, m/s": (("true", _LEFT), ("hall sensor", _RIGHT), ("wanted", _GREY)),
    "command": (("steering", _FRONT), ("throttle", _RIGHT)),
    "clearance error, m": (("error", _FRONT),),
}
"""Title of a chart -> its curves with their colours."""
_SPANS = ((0.0, 5.0), (0.0, 2.0), (-1.0, 1.0), (-0.5, 0.5))
"""What the charts show: the library finds no span by itself where a value is NaN."""


def values(car: CarFrame) -> tuple[float, ...]:
    """What the curves of all charts show of a moment, in the order of `CHARTS`; NaN: nothing."""
    ranges = [car.readings.get(f"ultrasonic_{side}", math.nan) for side in ("left", "front", "right")]
    return (
        *(math.nan if metres >= NO_ECHO_M else metres for metres in ranges),
        car.speed_mps,
        car.readings.get("speed", math.nan),
        car.wanted_mps,
        *car.action,
        car.clearance_error_m,
    )


class History:
    """What the curves showed lately."""

    def __init__(self) -> None:
        self._rows: deque[tuple[float, ...]] = deque(maxlen=round(SPAN_S / EVERY_S))

    def add(self, car: CarFrame) -> bool:
        """Take a moment, if it is later than the last one by `EVERY_S`; an earlier one begins anew."""
        if self._rows and car.time_s < self._rows[-1][0]:
            self._rows.clear()
        if self._rows and car.time_s - self._rows[-1][0] < EVERY_S - 1e-6:
            return False
        self._rows.append((car.time_s, *values(car)))
        return True

    def columns(self) -> NDArray[np.float64]:
        """(1 + curves, T) time and values."""
        count = 1 + sum(map(len, CHARTS.values()))
        return np.array(self._rows, float).T if self._rows else np.zeros((count, 1))


class Charts:
    """The charts in a panel."""

    def __init__(self, gui: viser.GuiApi) -> None:
        """Empty charts."""
        self.history = History()
        self._charts = []
        at = 1
        for (title, curves), span in zip(CHARTS.items(), _SPANS, strict=True):
            series = (uplot.Series(label="s"), *(_series(name, colour) for name, colour in curves))
            columns = self.history.columns()
            handle = gui.add_uplot(
                (columns[0], *columns[at : at + len(curves)]),
                series,
                title=title,
                scales={"x": uplot.Scale(time=False), "y": uplot.Scale(range=span)},
                legend=uplot.Legend(live=False),
                height=170,
            )
            self._charts.append((handle, slice(at, at + len(curves))))
            at += len(curves)

    def show(self) -> None:
        """Send what the history holds."""
        columns = self.history.columns()
        for handle, mine in self._charts:
            handle.data = (columns[0], *columns[mine])


def _series(name: str, colour: str) -> uplot.Series:
    return uplot.Series(label=name, stroke=colour, width=1.5, spanGaps=False, points={"show": False})
