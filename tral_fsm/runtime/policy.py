"""A machine as a policy: observations in, commands out, any number of cars."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.errors import MachineError
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.estimation.readings import Readings
from tral_fsm.formats import library
from tral_fsm.runtime.driver import Driver
from tral_fsm.runtime.machine import Trace

_SEEN = len(Readings._fields)


class MachinePolicy:
    """Drives cars with a state machine, each with its own."""

    def __init__(self, definition: MachineDefinition, trace: Trace | None = None) -> None:
        """Make a policy for one car; `reset(n)` for more.

        Args:
            definition: the machine.
            trace: called for each transition that fires in the first car.

        Raises:
            FormatError: the definition cannot run.
        """
        self.definition = definition
        self.needed_readings = library.needed_readings(definition)
        """Names of the readings without which the machine cannot drive, see `tral_env.interface.check_readings`."""
        self._trace = trace
        self._drivers: list[Driver] = []
        self.reset()

    def reset(self, n: int = 1) -> None:
        """Start again with n cars."""
        if n != len(self._drivers):
            self._drivers = [
                Driver(self.definition, self._trace if row == 0 else None, checked=row > 0) for row in range(n)
            ]
        for driver in self._drivers:
            driver.reset()

    def reset_rows(self, rows: NDArray[np.bool_]) -> None:
        """Start the cars again where `rows` (n,) is true.

        Raises:
            MachineError: `rows` is not one truth value for each car.
        """
        if np.shape(rows) != (len(self._drivers),) or np.asarray(rows).dtype != np.bool_:
            raise MachineError(
                f"rows to reset: got {np.asarray(rows).dtype} of shape {np.shape(rows)}, "
                f"expected bool of shape ({len(self._drivers)},)"
            )
        for row in np.flatnonzero(rows):
            self._drivers[row].reset()

    def act(self, observation: NDArray[np.floating]) -> NDArray[np.float32]:
        """Run one tick of every machine.

        Args:
            observation: (d,) or (n, d), the columns of `tral_env.interface.Layout`.

        Returns:
            (2,) or (n, 2) float32: steering, throttle.

        Raises:
            MachineError: the observation's rows or columns do not fit.
        """
        single = observation.ndim == 1
        rows = observation[None] if single else observation
        if rows.ndim != 2 or len(rows) != len(self._drivers) or rows.shape[1] < _SEEN:
            raise MachineError(
                f"observation has shape {observation.shape}, expected ({len(self._drivers)}, {_SEEN} or more): "
                "call reset(n) with the number of cars first"
            )
        readings = rows[:, :_SEEN].tolist()
        commands = [driver.act(row) for row, driver in zip(readings, self._drivers, strict=True)]
        action = np.array(commands, np.float32)
        return action[0] if single else action

    def predict(
        self,
        observation: NDArray[np.floating],
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """The signature of Stable-Baselines3's policies.

        Args:
            observation: (d,) or (n, d).
            state: returned unchanged, since each machine keeps its own.
            episode_start: (n,) true for cars whose episode begins now.
            deterministic: not used, since a machine always is.

        Returns:
            Action (2,) or (n, 2), and the state.
        """
        n = 1 if observation.ndim == 1 else len(observation)
        if n != len(self._drivers):
            self.reset(n)
        elif episode_start is not None:
            self.reset_rows(np.atleast_1d(episode_start))
        return self.act(observation), state

    @property
    def trace(self) -> Trace | None:
        """Called for each transition that fires in the first car."""
        return self._trace

    @trace.setter
    def trace(self, trace: Trace | None) -> None:
        self._trace = trace
        for driver in self._drivers[:1]:
            driver.trace = trace

    @property
    def active_states(self) -> list[str]:
        """Name of the active state of each car, or "stopped: " and why the watch has stopped it."""
        return [driver.active_path for driver in self._drivers]

    @property
    def wanted_clearance(self) -> NDArray[np.float64]:
        """(n, 2) per car: wall to which a clearance is kept, +1 left, -1 right, NaN none; that clearance [m]."""
        return np.array([driver.wanted_clearance for driver in self._drivers])

    @property
    def speed_target(self) -> NDArray[np.float64]:
        """(n,) speed that the active state regulates [m/s]; NaN: open loop."""
        return np.array([driver.speed_target for driver in self._drivers])


def load_policy(name_or_path: str | Path, trace: Trace | None = None) -> MachinePolicy:
    """The policy of a machine.

    Args:
        name_or_path: name of a packaged machine, or path of a file.
        trace: called for each transition that fires in the first car.

    Returns:
        A policy for one car; `reset(n)` for more.

    Raises:
        MachineError: no such machine, or it cannot run.
    """
    return MachinePolicy(library.load(name_or_path), trace)
