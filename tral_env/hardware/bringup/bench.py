"""The car on the bench: the actuator's process holds a command for a moment. Nothing moves while a person thinks.

Most boards take pulses, and a calibration has to find them: there the bench goes beyond those that the car file knows.
A board that takes commands gets those of a drive, so that the bench never shows anything that the drive does not do.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from tral_env.hardware.actuator.client import ActuatorProcess
from tral_env.hardware.actuator.drivers import takes_commands
from tral_env.hardware.actuator.laws import Channel, command_of, pulse_us
from tral_env.hardware.actuator.settings import Limits, Settings
from tral_env.hardware.car_file import CarFile
from tral_env.hardware.commands import Actuator
from tral_env.interface import CONTROL_PERIOD_S

STEERING_REACH_US, THROTTLE_REACH_US = 700, 250
"""On the bench, pulses come no farther from neutral than this, us."""
MAX_THROTTLE = 0.3
"""On the bench, the throttle of a drive comes no farther than this."""
_MIN_US, _MAX_US = 500.0, 2500.0


class Bench:
    """Holds pulses that a calibration does not know yet, within a reach around neutral."""

    def __init__(
        self,
        start: Callable[[Settings], Actuator] = ActuatorProcess,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Prepare a bench; the board is opened by `open`.

        Args:
            start: starts the actuator's process.
            clock: gives a time that never goes back, s.
            sleep: waits some seconds.
        """
        self._start, self.clock, self.sleep = start, clock, sleep

    @contextmanager
    def open(self, car: CarFile, *, arming_s: float | None = None) -> Iterator[Holder]:
        """The board of a car, in neutral; at the end of the block the pulses end.

        Args:
            car: whose board.
            arming_s: neutral stands this long before each move, s; None: as the car file says.

        Raises:
            HardwareError: the board does not answer.
        """
        limits = Limits(evidence_s=None, arming_s=car.limits.arming_s if arming_s is None else arming_s)
        if takes_commands(car.board.options):
            limits = replace(limits, max_throttle=MAX_THROTTLE, max_reverse=MAX_THROTTLE)
            settings = replace(car.settings, limits=limits)
        else:
            settings = replace(
                car.settings,
                limits=limits,
                steering=_wide(car.settings.steering, STEERING_REACH_US),
                throttle=_wide(car.settings.throttle, THROTTLE_REACH_US),
            )
        actuator = self._start(settings)
        try:
            yield Holder(actuator, settings, car.settings, self)
        finally:
            actuator.close()


class Holder:
    """An open board."""

    def __init__(self, actuator: Actuator, settings: Settings, drive: Settings, bench: Bench) -> None:
        """Take over a board that has sent neutral; `Bench.open` makes one.

        Args:
            actuator: holds the commands.
            settings: those of the board on the bench.
            drive: those of the board in a drive.
            bench: gives the time.
        """
        self._actuator, self._settings, self._drive, self._bench = actuator, settings, drive, bench

    @property
    def neutral_us(self) -> tuple[float, float]:
        """Pulses of steering and throttle at rest, us."""
        return self._settings.steering.centre_us, self._settings.throttle.centre_us

    def rest(self, seconds: float) -> None:
        """Hold neutral, disarmed, for some seconds."""
        until_s = self._bench.clock() + seconds
        while self._bench.clock() < until_s:
            self._actuator.neutral()
            self._bench.sleep(CONTROL_PERIOD_S)

    def drive(self, seconds: float, steering: float = 0.0, throttle: float = 0.0) -> None:
        """Arm, hold for some seconds what a drive sends for a command, then go to neutral.

        Args:
            seconds: for so long.
            steering: in [-1, 1], + is left.
            throttle: within `MAX_THROTTLE`, + is forward.

        Raises:
            HardwareError: the board failed; the process stops the car.
        """
        self.hold(seconds, pulse_us(steering, self._drive.steering), pulse_us(throttle, self._drive.throttle))

    def hold(self, seconds: float, steering_us: float | None = None, throttle_us: float | None = None) -> None:
        """Arm, hold pulses for some seconds, then go to neutral.

        Raises:
            HardwareError: the board failed; the process stops the car.
        """
        centre = self.neutral_us
        turn = command_of(centre[0] if steering_us is None else steering_us, self._settings.steering)
        drive = command_of(centre[1] if throttle_us is None else throttle_us, self._settings.throttle)
        self._actuator.arm()
        until_s = self._bench.clock() + seconds
        while self._bench.clock() < until_s:
            self._actuator.command(turn, drive, 0)
            self._bench.sleep(CONTROL_PERIOD_S)
            self._actuator.check()
        self._actuator.neutral()


def _wide(channel: Channel, reach_us: float) -> Channel:
    """A channel that reaches so far to both sides of its centre and skips nothing; + is the longer pulse."""
    low, high = max(channel.centre_us - reach_us, _MIN_US), min(channel.centre_us + reach_us, _MAX_US)
    return Channel(channel.output, low, channel.centre_us, high, 0.0, low, high, channel.dead_zone_us)
