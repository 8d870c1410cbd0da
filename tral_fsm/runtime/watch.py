"""What stops a car whose sensors have gone silent: readings and throttle in, a reason out."""

from __future__ import annotations

from collections.abc import Sequence

from tral_env.interface import CONTROL_PERIOD_S, CORE_LAYOUT
from tral_env.speed_control import THROTTLE_DEAD
from tral_fsm.control.command import Command
from tral_fsm.control.speed import BRAKE, MOVING_MPS, ROLLING_MPS, SingleBrake
from tral_fsm.definition.needs import HALL

MAX_SILENCE_S = 0.5
"""An ultrasonic that the machine needs may be silent for so long. Source: the slowest cadence of the cars is 0.11 s, so
that four rangings are lost; a reading is 0.18 s old at most when the next one comes. At 1 m/s the car needs 0.3 m to
stop."""
MIN_THROTTLE = 0.05
"""More throttle than this tells the car to drive. Source: ArduPilot Rover, CRASH_CHECK_THROTTLE_MIN."""
MAX_STANDSTILL_S = 1.2
"""A car may stand for so long in all while it is told to drive. Source: measured; a healthy car stands for 0.68 s at
most. The crash check of ArduPilot Rover waits for 2 s, in which a car whose hall sensor is dead reaches 1 m/s."""
ROLLING_ON_MPS = 0.3
"""A car that counted a hall tick at this speed, and is driven on, soon counts the next one. Source: choice."""
SLOWING_MPS2 = 4.0
"""A car that is not driven on loses no more speed than this, m/s^2. Source: choice, about twice what `BRAKE` does."""
MAX_PAUSE_S = 0.5
"""Such a car counts the next hall tick within this time, even at a sixth of the speed. Source: choice."""
BLIND_BRAKE_S = 1.0
"""Time for which the car brakes when no speed can be trusted: enough for 1.5 m/s. A motor controller reverses only
after brake and neutral, so a standing car stays. Source: choice."""

_DISTANCE, _SPEED = CORE_LAYOUT.column("distance"), CORE_LAYOUT.column("speed")


class Watch:
    """Watches the sensors of one car. Once it has a reason to stop, it keeps the reason until it is reset.

    - An ultrasonic that the machine needs is silent: its age exceeds `MAX_SILENCE_S`; after a reset it gets as long for
      its first reading.
    - The hall sensor stops counting although the car was rolling and is driven on.
    - The car is told to drive, but does not move: the hall sensor is dead, or the car is stuck. Pauses do not count, so
      that the neutral in which a stalled car tries again does not hide it.
    """

    __slots__ = (
        "_brake",
        "_distance",
        "_needs_hall",
        "_paused",
        "_pushed",
        "_ranges",
        "_rolled",
        "_speed_known",
        "_stopped",
        "_ticks",
        "reason",
    )

    def __init__(self, needed: frozenset[str]) -> None:
        """Watch what a machine needs.

        Args:
            needed: names of readings, see `definition.machine.needed_readings`.
        """
        self._ranges = tuple(
            (name, CORE_LAYOUT.column(f"{name}_age")) for name in sorted(needed) if name.startswith("ultrasonic_")
        )
        self._needs_hall = bool(needed & HALL)
        self.reset()

    def reset(self) -> None:
        """Start anew."""
        self.reason = ""
        """Why the car must stop; empty: it may drive."""
        self._ticks = 0
        self._pushed = 0
        """Ticks without motion in which the car was told to drive."""
        self._distance = 0.0
        self._rolled = 0.0
        """Speed that the car has at least, by its last hall tick and what it may have lost since, m/s."""
        self._paused = 0
        """Ticks without a hall tick in which the car was driven on."""
        self._stopped = 0
        self._brake = SingleBrake()
        self._speed_known = self._needs_hall

    def update(self, row: Sequence[float], command: Command, throttle: float) -> str:
        """Take the readings of a tick.

        Args:
            row: in the order of `interface.CORE_FIELDS`.
            command: the machine's answer in the tick before.
            throttle: the throttle that it became.

        Returns:
            Why the car must stop; empty: it may drive.
        """
        if self.reason:
            return self.reason
        self._ticks += 1
        for name, column in self._ranges:
            age = row[column]
            if age > MAX_SILENCE_S and self._ticks * CONTROL_PERIOD_S > MAX_SILENCE_S:
                self.reason = f"{name} silent for {min(age, self._ticks * CONTROL_PERIOD_S):.1f} s"
                return self.reason
        self._watch_hall(row, command, throttle)
        return self.reason

    def _watch_hall(self, row: Sequence[float], command: Command, throttle: float) -> None:
        distance, speed = row[_DISTANCE], row[_SPEED]
        driving = (throttle > MIN_THROTTLE or throttle < -MIN_THROTTLE) and self._is_driving(command)
        driven_on = driving and throttle > THROTTLE_DEAD
        if not driven_on:
            self._rolled -= SLOWING_MPS2 * CONTROL_PERIOD_S
        if distance != self._distance:
            self._distance, self._rolled = distance, speed
            self._paused = self._pushed = 0
            return
        if speed >= MOVING_MPS:
            self._pushed = 0
        self._pushed += driving
        self._paused += driven_on
        if self._rolled >= ROLLING_ON_MPS and self._paused * CONTROL_PERIOD_S > MAX_PAUSE_S:
            self._blame_hall(f"no hall tick for {MAX_PAUSE_S:g} s of driving on from {self._rolled:.1f} m/s")
        elif self._pushed * CONTROL_PERIOD_S > MAX_STANDSTILL_S:
            self._blame_hall(f"told to drive for {MAX_STANDSTILL_S:g} s, but distance and speed do not change")

    def _blame_hall(self, reason: str) -> None:
        self._speed_known, self.reason = False, reason

    def _is_driving(self, command: Command) -> bool:
        """Whether a command with a throttle is to move the car, and the hall sensor is there to see it: a Stop brakes,
        an open loop may do without."""
        return command.speed != 0.0 and (self._needs_hall or command.throttle is None)

    def stop(self, speed: float, direction: float) -> Command:
        """Brake, then neutral, with the wheels straight.

        Args:
            speed: as read, m/s.
            direction: +1 forward, -1 reverse, when the reason came.
        """
        self._stopped += 1
        rolls = speed > ROLLING_MPS if self._speed_known else self._stopped * CONTROL_PERIOD_S <= BLIND_BRAKE_S
        brakes = self._brake.tick(rolls)
        return Command(steering=0.0, speed=0.0, throttle=-BRAKE * direction if brakes else 0.0)
