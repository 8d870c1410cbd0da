"""The guided calibration of a car: its steps in their order, each kept as soon as it is done."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from tral_env.checks import one_of
from tral_env.errors import ConfigError
from tral_env.hardware.bringup.bench import Bench
from tral_env.hardware.bringup.car_text import CarText
from tral_env.hardware.bringup.person import BrokenOff, Person
from tral_env.hardware.bringup.steps import Guided, do, missing_steps, needed_steps
from tral_env.hardware.bringup.steps_board import BOARD_STEPS
from tral_env.hardware.bringup.steps_sensors import SENSOR_STEPS

_STEPS = {step.name: step for step in (*BOARD_STEPS, *SENSOR_STEPS)}


def calibrate(
    path: Path, person: Person | None = None, bench: Bench | None = None, steps: Iterable[str] = ()
) -> tuple[str, ...]:
    """Guide a person through the calibration of a car.

    A step that was done before is passed over, so that a calibration that was broken off goes on where it stood.

    Args:
        path: of the car file, which is changed after each step.
        person: who answers; None: the terminal.
        bench: drives the board; None: the actuator's process.
        steps: names of the steps to do, also again; empty: those that are missing.

    Returns:
        Names of the steps that are still missing.

    Raises:
        ConfigError: there is no such step, the car does not need it, or the board's clock has to be measured first.
        BadFileError: the file is no car file.
        HardwareError: a device does not answer.
    """
    guided = Guided(file=CarText(path), person=person or Person(), bench=bench or Bench())
    needed = needed_steps(guided.car)
    chosen = tuple(steps) or missing_steps(guided.car)
    for name in chosen:
        one_of("step", name, _STEPS)
        if name not in needed:
            raise ConfigError(f"step '{name}': this car does not need it. It needs: {', '.join(needed)}")
    if chosen:
        guided.person.say(f"Steps to do: {', '.join(chosen)}. At each question, q ends and keeps what was done.")
    try:
        for name in chosen:
            do(_STEPS[name], guided)
    except (BrokenOff, KeyboardInterrupt):
        guided.person.say("\nbroken off; the same command goes on here")
    missing = missing_steps(guided.car)
    guided.person.say(
        f"Still missing: {', '.join(missing)}" if missing else f"All steps are done. Next: tral car check {path}"
    )
    return missing
