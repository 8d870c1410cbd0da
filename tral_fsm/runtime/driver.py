"""One car at work: readings -> estimate -> command -> actuators."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tral_env.se2 import clip
from tral_fsm.control.command import IDLE, MAX_SPEED_MPS, Command
from tral_fsm.control.speed import SpeedController
from tral_fsm.definition import packaged
from tral_fsm.definition.machine import Load, MachineDefinition, needed_readings
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.estimator import Estimator
from tral_fsm.runtime.machine import Machine, Trace
from tral_fsm.runtime.watch import Watch


class Driver:
    """A machine that drives one car."""

    def __init__(
        self,
        definition: MachineDefinition,
        trace: Trace | None = None,
        *,
        load: Load | None = None,
        checked: bool = False,
    ) -> None:
        """Build the machine.

        Args:
            definition: the machine.
            trace: called for each transition that fires.
            load: for the packaged machines that the machine names; None: those of this package.
            checked: the definition has been checked already.

        Raises:
            FormatError: the definition cannot run.
        """
        load = load or packaged.load
        self._load = load
        self.machine = Machine(definition, trace, load=load, checked=checked)
        self.watch = Watch(needed_readings(definition, load))
        self._shadows = False
        self.speed_factor = 1.0
        """What each speed that the machine regulates is multiplied by."""
        self.reset()

    def reset(self) -> None:
        """Start anew at a new place."""
        self.machine.restart()
        self.watch.reset()
        self.estimator = Estimator()
        self.speed_controller = SpeedController()
        self.estimate = CarEstimate()
        """What the machine was given last."""
        self.command = IDLE
        """What the car was told last: the machine's answer, or that of the watch since it stopped the car."""
        self._throttle = 0.0
        """Throttle that the car was told by this driver; 0 while another one drives."""
        self._direction = 1.0

    def retune(self, definition: MachineDefinition) -> None:
        """Go on with other parameters of the machine; see `Machine.retune`."""
        before = needed_readings(self.machine.definition, self._load)
        self.machine.retune(definition)
        if (needed := needed_readings(definition, self._load)) != before:
            reason, self.watch = self.watch.reason, Watch(needed)
            self.watch.reason = reason

    def shadow(self, shadows: bool) -> None:
        """Leave the car to another one from now on, or drive it again.

        The car does not obey a driver that shadows. So each of its answers is what the machine would do from its
        estimate here and now: a line in the corridor begins at the car, the speed regulator sums nothing up, and the
        watch does not ask whether the car moves.
        """
        if shadows != self._shadows:
            self._shadows = shadows
            self.watch.reset()

    def go_to(self, index: int) -> None:
        """Let another state of the machine be active from now on; see `Machine.go_to`."""
        if index != self.machine.active_index:
            target = self.machine.go_to(index, self.estimate)
            self.command = self.command if target is None else self.command._replace(target=target)

    def act(self, row: Sequence[float]) -> tuple[float, float]:
        """One tick.

        Args:
            row: the readings in the order of `estimation.readings.Readings`.

        Returns:
            Steering and throttle.
        """
        before = self.command
        self.estimate = estimate = self.estimator.update(row, before.steering_trim, before.target)
        if self.watch.update(row, before, self._throttle):
            command = self.watch.stop(estimate.speed, self._direction)
        else:
            self._direction = estimate.direction
            if self._shadows:
                self.machine.shadow(estimate)
            command = self.machine.tick(estimate)
        if command.steering_trim is None:
            command = command._replace(steering_trim=before.steering_trim)
        if command.speed is not None and self.speed_factor != 1.0:
            command = command._replace(speed=min(command.speed * self.speed_factor, MAX_SPEED_MPS))
        self.command = command
        throttle = self.speed_controller.throttle(command, estimate.speed)
        self._throttle = throttle
        if self._shadows:
            self._throttle = 0.0
            self.speed_controller = SpeedController()
        return self._steering(command), throttle

    def _steering(self, command: Command) -> float:
        """Steering in [-1, 1] that the real car needs for a command: command / gain + given trim + learnt offset."""
        if command.steering is None:
            return 0.0
        straight = self.estimator.straight_steering(command.steering_trim)
        return clip(command.steering / self.estimator.steering_gain + straight)

    @property
    def active_path(self) -> str:
        """Name of the active state, with those of inner machines behind a slash; or why the watch stopped the car."""
        reason = self.watch.reason
        return f"stopped: {reason}" if reason else self.machine.active_path

    @property
    def wanted_clearance(self) -> tuple[float, float]:
        """Wall to which a clearance is kept, +1 left, -1 right, NaN none; that clearance [m]."""
        return self.command.wanted_side, self.command.wanted_clearance

    @property
    def speed_target(self) -> float:
        """Speed that the active state regulates [m/s]; NaN: open loop."""
        return math.nan if self.command.speed is None else self.command.speed

    @property
    def trace(self) -> Trace | None:
        """Called for each transition that fires."""
        return self.machine.trace

    @trace.setter
    def trace(self, trace: Trace | None) -> None:
        self.machine.watch(trace)
