"""A machine as a policy: observations in, commands out, any number of cars."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.checks import check_number, check_rows
from tral_env.errors import ConfigError, MachineError
from tral_env.interface import CORE_LAYOUT
from tral_fsm.definition import packaged
from tral_fsm.definition.checks import FormatError, check
from tral_fsm.definition.machine import MachineDefinition, needed_readings
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.runtime.driver import Driver
from tral_fsm.runtime.machine import Trace
from tral_fsm.runtime.observations import as_array, checked_rows

_DISTANCE = CORE_LAYOUT.column("distance")


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
        self._trace = trace
        self._drivers: list[Driver] = []
        self.reset()
        self.needed_readings = needed_readings(definition, packaged.load)
        """Names of the readings without which the machine cannot drive, see `tral_env.interface.check_readings`."""

    def reset(self, n: int = 1) -> None:
        """Start again with n cars.

        Raises:
            ConfigError: n is no whole number, 1 or more.
        """
        check_number("number of cars", n, whole=True)
        if n < 1:
            raise ConfigError(f"number of cars = {n}: expected 1 or more")
        if n != len(self._drivers):
            self._drivers = [
                Driver(self.definition, self._trace if row == 0 else None, checked=row > 0) for row in range(n)
            ]
        else:
            for driver in self._drivers:
                driver.reset()
                driver.shadow(False)
                driver.speed_factor = 1.0
        self._driving = False
        """The cars have been driven since then."""

    def reset_rows(self, rows: NDArray[np.bool_]) -> None:
        """Start the cars again where `rows` (n,) is true.

        Raises:
            MachineError: `rows` is not one truth value for each car.
        """
        check_rows("rows to reset", rows, len(self._drivers), MachineError)
        for row in np.flatnonzero(rows):
            self._drivers[row].reset()

    def retune(self, definition: MachineDefinition) -> None:
        """Go on with other parameters of the machine, in the middle of a drive.

        What states and conditions remember of the drive stays, and so does the active state.

        Args:
            definition: a machine with the same states and transitions.

        Raises:
            FormatError: the definition cannot run.
            MachineError: its states, transitions or types are others.
        """
        if problems := check(definition, packaged.load):
            raise FormatError(definition.name or "machine", problems)
        for driver in self._drivers:
            driver.retune(definition)
        self.definition = definition
        self.needed_readings = needed_readings(definition, packaged.load)

    def shadow(self, rows: NDArray[np.bool_]) -> None:
        """Leave the cars where `rows` (n,) is true to another policy from now on, and drive the others.

        The commands for a car that is shadowed are what its machine would do from its estimate here and now: they do
        not depend on earlier commands, which the car did not obey. Its watch looks at the sensors alone, not at whether
        the car moves. After `reset` all cars are driven; `reset_rows` changes nothing.

        Raises:
            MachineError: `rows` is not one truth value for each car.
        """
        check_rows("rows to shadow", rows, len(self._drivers), MachineError)
        for driver, shadows in zip(self._drivers, np.asarray(rows).tolist(), strict=True):
            driver.shadow(shadows)

    def go_to(self, rows: NDArray[np.intp], states: NDArray[np.intp]) -> None:
        """Let the machines of some cars be in other states from now on, as the policy that drives them believes.

        Args:
            rows: (k,) numbers of the cars.
            states: (k,) places of the states among those of the definition.
        """
        for row, state in zip(rows.tolist(), states.tolist(), strict=True):
            self._drivers[row].go_to(state)

    def scale_speeds(self, factors: NDArray[np.floating]) -> None:
        """Multiply the regulated speeds of each car's machine by a factor of `factors` (n,) from now on.

        A throttle that a state gives without regulation stays as it is. After `reset` all factors are 1.

        Raises:
            MachineError: `factors` is not one number, 0 or more, for each car.
        """
        found = np.asarray(factors, np.float64)
        if found.shape != (len(self._drivers),) or not ((found >= 0.0) & (found < np.inf)).all():
            raise MachineError(f"speed factors: expected a number, 0 or more, for each of {len(self._drivers)} cars")
        for driver, factor in zip(self._drivers, found.tolist(), strict=True):
            driver.speed_factor = factor

    def act(self, observation: NDArray[np.floating]) -> NDArray[np.float32]:
        """Run one tick of every machine.

        A car whose distance has fallen begins a new episode: its machine starts again.

        Args:
            observation: (d,) or (n, d), the columns of `tral_env.interface.Layout`.

        Returns:
            (2,) or (n, 2) float32: steering, throttle.

        Raises:
            ConfigError: the observation is none: no array, of another shape, NaN, or out of its bounds.
        """
        commands = []
        rows = checked_rows(observation, len(self._drivers))
        self._driving = True
        for row, driver in zip(rows, self._drivers, strict=True):
            if row[_DISTANCE] < driver.estimate.distance:
                driver.reset()
            commands.append(driver.act(row))
        return np.array(commands[0] if observation.ndim == 1 else commands, np.float32)

    def predict(
        self,
        observation: NDArray[np.floating],
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """The signature of Stable-Baselines3's policies.

        The number of cars is that of the first call after a `reset`; it may change where every car begins an episode.

        Args:
            observation: (d,) or (n, d).
            state: returned unchanged, since each machine keeps its own.
            episode_start: (n,) true for cars whose episode begins now. Without it a new episode is known by its
                distance, which has fallen; so give it where a car may end an episode without having moved.
            deterministic: not used, since a machine always is.

        Returns:
            Action (2,) or (n, 2), and the state.

        Raises:
            ConfigError: the observation is none, see `act`, or has another number of cars in the middle of a drive.
            MachineError: `episode_start` is not one truth value for each car.
        """
        return self.act(self.begin_episodes(observation, episode_start)), state

    def begin_episodes(
        self, observation: NDArray[np.floating], episode_start: NDArray[np.bool_] | None = None
    ) -> NDArray[np.floating]:
        """Start the cars again whose episode begins now, as `predict` does before it acts.

        Returns:
            The observation as an array.
        """
        observation = as_array(observation)
        n = max(len(observation), 1) if observation.ndim > 1 else 1
        if n != len(self._drivers) and (not self._driving or (episode_start is not None and np.all(episode_start))):
            checked_rows(observation, n)
            self.reset(n)
        if n == len(self._drivers) and episode_start is not None:
            self.reset_rows(np.atleast_1d(episode_start))
        return observation

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
    def active_indices(self) -> NDArray[np.intp]:
        """(n,) place of each car's active state among those of the definition, whatever its watch says."""
        return np.array([driver.machine.active_index for driver in self._drivers], np.intp)

    @property
    def estimates(self) -> list[CarEstimate]:
        """What the machine of each car was given last, in the frame of its dead reckoning."""
        return [driver.estimate for driver in self._drivers]

    @property
    def wanted_clearance(self) -> NDArray[np.float64]:
        """(n, 2) per car: wall to which a clearance is kept, +1 left, -1 right, NaN none; that clearance [m]."""
        return np.array([driver.wanted_clearance for driver in self._drivers])

    @property
    def speed_target(self) -> NDArray[np.float64]:
        """(n,) speed that the active state regulates [m/s]; NaN: open loop."""
        return np.array([driver.speed_target for driver in self._drivers])
