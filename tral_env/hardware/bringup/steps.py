"""What all steps of the guided calibration share, and which of them a car needs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from tral_env.errors import BadFileError
from tral_env.hardware.actuator.drivers import takes_commands
from tral_env.hardware.bringup.bench import Bench
from tral_env.hardware.bringup.car_text import CarText
from tral_env.hardware.bringup.person import Person
from tral_env.hardware.car_file import STEPS, CarFile
from tral_env.hardware.opening import require_clock


@dataclass(frozen=True, kw_only=True)
class Guided:
    """A calibration that is under way."""

    file: CarText
    person: Person
    bench: Bench

    @property
    def car(self) -> CarFile:
        """The car as it is known by now."""
        return self.file.car


Found = Mapping[tuple[str | int, ...], Any]
"""What a step found: path in the car file -> value."""


@dataclass(frozen=True, kw_only=True)
class Step:
    """One step of the calibration."""

    name: str
    title: str
    moves: bool
    """Whether it sends pulses that mean something only if the board's clock is known."""
    run: Callable[[Guided], Found]
    """Does the step, and gives what it found."""


def needed_steps(car: CarFile) -> tuple[str, ...]:
    """Names of the steps that a car needs, in their order.

    A board that takes commands makes its pulses by itself, so that there are none to find.
    """
    drivers = {sensor.driver for sensor in car.sensors}
    needed = dict.fromkeys(("neutral", "ends", "dead_zone"), not takes_commands(car.board.options)) | {
        "clock": car.board.options.has_own_clock,
        "hall": bool(drivers & {"hall", "board2016", "ucboard"}),
        "sonars": bool(drivers & {"srf08", "srf02", "board2016", "ucboard"}),
        "camera": car.camera is not None,
    }
    return tuple(name for name in STEPS if needed.get(name, True))


def missing_steps(car: CarFile) -> tuple[str, ...]:
    """Names of the steps that a car still lacks; the clock counts by what the board says of it."""
    done = set(car.calibrated) | ({"clock"} if car.calibration.clock_measured else set())
    return tuple(name for name in needed_steps(car) if name not in done)


def do(step: Step, guided: Guided) -> None:
    """Do a step, and write what it found.

    Raises:
        ConfigError: it would drive a motor from a board whose clock was never measured.
        HardwareError: it found nothing, or a device does not answer; nothing of this step was written.
        BrokenOff: the person ended it; nothing of this step was written.
    """
    guided.file.read()
    if step.moves:
        require_clock(guided.car)
    guided.person.say(f"\n== {step.title}")
    while True:
        found = step.run(guided)
        try:
            guided.file.done(step.name, dict(found))
        except BadFileError as error:
            guided.person.say(f"  this cannot be: {error}\n  Nothing was written. Once more")
        else:
            break
    guided.person.say(f"  done: {step.name} is in {guided.file.path}")
