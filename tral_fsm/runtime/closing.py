"""Does the hall sensor count the way that the front ultrasonic sees? Readings in, a reason to stop out."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from tral_env.interface import CONTROL_PERIOD_S, CORE_LAYOUT, MAX_AGE_S
from tral_fsm.estimation.sonar import MAX_ECHO_RANGE_M, is_new

READINGS = 9
"""So many echoes in a row are looked at: 0.6 to 1 s. Source: choice, so that a car at twice its speed still stops."""
LAG = 3
"""Ranges are compared with those so many readings before, so that the steps of the hall sensor matter less."""
NEEDED = 4
"""So many of the `READINGS` - `LAG` differences must be too large. A jump from one thing to another is in one fewer."""
MAX_STEP_M = 0.4
"""A range that changes by more than this from one reading to the next is that of another thing, m. Source: 3 m/s."""
MAX_RATIO = 1.5
"""The range ahead shrinks by no more than this share of the counted way. Source: measured, docs/state_machine.md."""
ROOM_M = 0.08
"""And by this much more, m: a hall tick, and the noise of two ranges. Source: choice."""
MAX_STEERING = 0.35
"""While a car steers more than this, one thing after the other comes into the beam of its front ultrasonic. Source:
measured; two of 60 healthy drives of `office` on "hard" looked too fast at 0.69 and 0.88."""
_HISTORY_TICKS = 64
"""Ticks for which counted distances are kept: 0.8 s; a range is 0.2 s old at most when it comes."""

_RANGE, _AGE = CORE_LAYOUT.column("ultrasonic_front"), CORE_LAYOUT.column("ultrasonic_front_age")
_STEERING = CORE_LAYOUT.column("steering")
_DISTANCE = CORE_LAYOUT.column("distance")


class Closing:
    """Compares how fast the front range shrinks with how fast the hall sensor counts, for one car.

    Whatever stands ahead comes nearer by the way that the car drives, or by less if it stands askew. If it comes nearer
    by much more, the hall sensor counts too few ticks, and the car is faster than it knows; or something drives or
    walks towards the car. It cannot tell these two apart.
    """

    __slots__ = ("_age", "_counted", "_echoes")

    def __init__(self) -> None:
        self._counted: deque[float] = deque(maxlen=_HISTORY_TICKS)
        """Counted distance, tick by tick, m."""
        self._echoes: deque[tuple[float, float]] = deque(maxlen=READINGS)
        """Range and the distance counted when the sensor fired, m."""
        self._age = MAX_AGE_S

    def update(self, row: Sequence[float]) -> str:
        """Take the readings of a tick.

        Args:
            row: in the order of `interface.CORE_FIELDS`.

        Returns:
            What does not fit together; empty: nothing, or it is not known.
        """
        counted, age = self._counted, row[_AGE]
        counted.append(row[_DISTANCE])
        before, self._age = self._age, age
        if abs(row[_STEERING]) > MAX_STEERING:
            self._echoes.clear()
            return ""
        if not is_new(age, before):
            return ""
        range_m, echoes = row[_RANGE], self._echoes
        if range_m > MAX_ECHO_RANGE_M or (echoes and abs(range_m - echoes[-1][0]) > MAX_STEP_M):
            echoes.clear()
        if range_m > MAX_ECHO_RANGE_M:
            return ""
        fired = min(int(age / CONTROL_PERIOD_S + 0.5), len(counted) - 1)
        echoes.append((range_m, counted[-1 - fired]))
        return self._contradiction() if len(echoes) == READINGS else ""

    def _contradiction(self) -> str:
        echoes = tuple(self._echoes)
        way = (echoes[-1][1] - echoes[0][1]) * LAG / (READINGS - 1)
        shrunk = sorted(old[0] - new[0] for old, new in zip(echoes, echoes[LAG:], strict=False))
        typical = shrunk[-NEEDED]
        if typical <= MAX_RATIO * way + ROOM_M:
            return ""
        return (
            f"what is ahead came {typical:.2f} m nearer while the hall sensor counted {way:.2f} m: it counts too few "
            "ticks, or something comes towards the car"
        )
