"""The one loop in which policies drive: rows of cars, each with its own episode; a single env is one row."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tral_env.world import Step
from tral_fsm.evaluation.episode import Tick
from tral_fsm.evaluation.metrics import Metrics, clearance_error, true_clearances
from tral_fsm.runtime.machine import Trace, Transit

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Pair = tuple[float, float]
Observer = Callable[[Tick], None]
"""Called after each tick of one episode."""


class Cars(Protocol):
    """n cars on their courses."""

    def observation(self) -> NDArray[np.floating]:
        """Observations of the policies, (n, d)."""
        ...

    def step(self, command: NDArray[np.floating], rows: Index | None = None) -> Step:
        """Drive all cars, or those of the rows, for one tick; `command` is (n, 2)."""
        ...


class Policies(Protocol):
    """The policies, one for each row."""

    def act(self, rows: Index, observation: NDArray[np.floating]) -> tuple[Sequence[Any], Sequence[Pair]]:
        """Commands and wanted clearances of the k rows, from the observations of all n rows."""
        ...

    def state(self, row: int) -> str:
        """Name of the active state; empty for a policy without states."""
        ...

    def watch(self, row: int, trace: Trace | None) -> None:
        """Call this for each transition that fires in a row; None: nothing."""
        ...


class _Watched:
    """An episode with observers."""

    def __init__(self, observers: Sequence[Observer]) -> None:
        self.observers, self.index = observers, 0
        self.fired: list[Transit] = []
        self.seen: NDArray[np.floating] = np.zeros(0)
        self.state = ""


class DriveLoop:
    """Rows that drive until `end` is called for them."""

    def __init__(
        self, n: int, cars: Cars, policies: Policies, info_of: Callable[[Step, int], Mapping[str, Any]] | None = None
    ) -> None:
        """Make the loop; no row drives before `begin`.

        Args:
            n: number of rows.
            cars: the cars.
            policies: the policies.
            info_of: gives observers the info of a row; None: the row's part of the step's info.
        """
        self.cars, self.policies, self.n = cars, policies, n
        self._info_of = info_of or row_info
        self.metrics = Metrics(n)
        self.active = np.zeros(0, np.int64)
        """Rows that drive, ascending."""
        self._command = np.zeros((n, 2), np.float32)
        self._watched: dict[int, _Watched] = {}
        self._observation: NDArray[np.floating] = np.zeros((n, 0))

    def begin(self, rows: Index, observers: Mapping[int, Sequence[Observer]] | None = None) -> None:
        """Start episodes in rows whose cars and policies stand at the start.

        Args:
            rows: (k,) the rows.
            observers: row -> functions that are called with each of its ticks.
        """
        self.metrics.begin(rows)
        for row, wanted in (observers or {}).items():
            self._watched[row] = watched = _Watched(wanted)
            self.policies.watch(row, watched.fired.append)
        self.active = np.union1d(self.active, rows)
        self._observation = self.cars.observation()

    def end(self, row: int) -> None:
        """End the episode of a row."""
        if self._watched.pop(row, None) is not None:
            self.policies.watch(row, None)
        self.active = self.active[self.active != row]

    def tick(self) -> Step:
        """Let the policies decide, drive all rows for one tick, and measure."""
        rows, before = self.active, self._observation
        for row, watched in self._watched.items():
            watched.seen, watched.state = np.array(before[row]), self.policies.state(row)
        commands, wishes = self.policies.act(rows, before)
        self._command[rows] = commands
        step = self.cars.step(self._command, None if len(rows) == self.n else rows)
        self._observation = step.observation
        wanted = np.array(wishes, float)
        error = self._error(step, wanted)
        steering = np.minimum(np.maximum(self._command[rows, 0].astype(np.float64), -1.0), 1.0)
        self.metrics.add(rows, step.info, wanted, error, steering)
        if self._watched:
            self._show(step, wanted, error)
        return step

    def _error(self, step: Step, wanted: Array) -> Array:
        """Clearance errors of the active rows, (k,)."""
        if np.isnan(wanted[:, 0]).all():
            return np.full(len(wanted), np.nan)
        left, right = true_clearances(step.info)
        return clearance_error(left[self.active], right[self.active], wanted)

    def _show(self, step: Step, wanted: Array, error: Array) -> None:
        """Show observers the tick of their rows."""
        for place, row in enumerate(self.active.tolist()):
            watched = self._watched.get(row)
            if watched is None:
                continue
            side, metres = wanted[place].tolist()
            tick = Tick(
                index=watched.index,
                observation=watched.seen,
                state=watched.state if watched.fired else self.policies.state(row),
                action=self._command[row].copy(),
                info=self._info_of(step, row),
                transits=tuple(watched.fired),
                wanted=(side, metres),
                clearance_error=float(error[place]),
            )
            watched.fired.clear()
            watched.index += 1
            for observer in watched.observers:
                observer(tick)


def row_info(step: Step, row: int) -> dict[str, Any]:
    """Info of one row."""
    return {name: values[row] for name, values in step.info.items()}
