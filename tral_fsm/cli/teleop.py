"""`tral teleop`: a person drives."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tral_env.errors import ConfigError
from tral_fsm.cli import hands
from tral_fsm.cli.deploy import AsJson, Dry, Out, Record, Seconds
from tral_fsm.programs.cockpit import Cockpit
from tral_fsm.programs.seat import Course
from tral_fsm.programs.teleop import TeleopArguments, run
from tral_fsm.teleop.shaping import Shaping

Config = Annotated[str | None, typer.Option(help="Drive the real car of this car file.")]
Scenario = Annotated[str | None, typer.Option(help="Drive a simulated car on courses of this family.")]
CourseFile = Annotated[str | None, typer.Option("--course", help="Drive a simulated car on one course.")]
Seed = Annotated[int | None, typer.Option(min=0, help="Seed of the simulated car and its course; 7 if left out.")]
Randomized = Annotated[
    str | None,
    typer.Option(help="How much simulated cars differ from seed to seed: none, default, hard, or a file of ranges."),
]
MaxThrottle = Annotated[float, typer.Option(min=0.0, max=1.0, help="Throttle at the end of the trigger.")]


def command(
    config: Config = None,
    scenario: Scenario = None,
    course: CourseFile = None,
    seed: Seed = None,
    randomization: Randomized = None,
    dry: Dry = False,
    gamepad: hands.Gamepad = False,
    gamepad_file: hands.GamepadFile = None,
    max_throttle: MaxThrottle = Shaping.max_throttle,
    seconds: Seconds = 600.0,
    out: Out = Path("runs/teleop"),
    record: Record = True,
    as_json: AsJson = False,
) -> None:
    """Drive a car by hand, the real one or a simulated one in real time.

    Gamepad: the left stick steers, the right trigger drives, the left one brakes and reverses, while LB is held; start
    arms, B stops, back ends. Keyboard: w, s, a, d or arrows while they are held; + and - change the throttle; r arms,
    space stops, q ends.
    """
    from tral_fsm.teleop.keyboard import Keyboard

    arguments = TeleopArguments(
        config=config,
        course=_simulated(scenario, course, seed, randomization),
        dry=dry,
        max_duration_s=seconds,
        record=record,
        shaping=Shaping(max_throttle=max_throttle),
    )
    with hands.devices(gamepad, gamepad_file, Keyboard) as devices:
        report = run(arguments, Cockpit(out=out, devices=devices, console=hands.TerminalConsole()))
    hands.tell(report, out, as_json)


def _simulated(scenario: str | None, course: str | None, seed: int | None, randomization: str | None) -> Course | None:
    """The simulated car that the options ask for; None: they ask for none."""
    if scenario is None and course is None:
        for option, value in (("--seed", seed), ("--randomization", randomization)):
            if value is not None:
                raise ConfigError(f"{option} is for a simulated car: give --scenario or --course, or leave it out")
        return None
    return Course(
        scenario=scenario or "office",
        seed=7 if seed is None else seed,
        course=course,
        randomization=randomization or "default",
    )
