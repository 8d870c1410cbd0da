"""`tral car`: the car file of a real car, its guided calibration, and the check before a drive."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from tral_fsm.cli.console import FAILED

app = typer.Typer(no_args_is_help=True, help="A real car: write its car file, calibrate it, check it before a drive.")
File = Annotated[Path, typer.Argument(help="Car file.")]


@app.command("init")
def init(
    file: File = Path("car.toml"),
    name: Annotated[str, typer.Option(help="Which car this is.")] = "car",
    board: Annotated[
        str, typer.Option(help="Board that makes the pulses: pca9685, sysfs-pwm, board2016, ucboard, log.")
    ] = "pca9685",
    sensor: Annotated[
        list[str] | None,
        typer.Option(
            help="Sensors, each with an option: srf08, srf02, hall, board2016, ucboard; or none. Default: by the board."
        ),
    ] = None,
    camera: Annotated[bool, typer.Option(help="Whether the car has a camera.")] = True,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is there.")] = False,
) -> None:
    """Write a car file to begin with: every option stands in it, with its meaning."""
    from tral_env.hardware.bringup.template import write_car

    write_car(file, name, force=force, board=board, sensors=sensor, camera=camera)
    typer.echo(f"{file} is written. Look at it, then: tral car calibrate {file}")


@app.command("calibrate")
def calibrate(
    file: File = Path("car.toml"),
    step: Annotated[
        list[str] | None,
        typer.Option(
            help="Only this step, also again: clock, neutral, ends, direction, dead_zone, arming, hall, sonars, camera."
        ),
    ] = None,
) -> None:
    """Calibrate a car, guided: wheels up, at the keyboard, also over ssh.

    Each step is kept when it is done, so the command may be broken off by q or Ctrl-C, and goes on there. It drives no
    motor from a board whose clock was never measured. The exit code is 1 while steps are missing.
    """
    from tral_env.hardware.bringup.guide import calibrate as guided

    if guided(file, steps=step or ()):
        raise typer.Exit(FAILED)


@app.command("check")
def check(
    file: File = Path("car.toml"),
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """Check a car before a drive: calibration, board, every sensor, battery. The exit code is 1 if something is wrong.

    The board is set up in neutral, so keep clear of the car.
    """
    from tral_env.hardware.bringup.preflight import check_car
    from tral_env.hardware.car_file import load_car

    findings = check_car(load_car(file))
    if as_json:
        typer.echo(json.dumps([vars(finding) for finding in findings], indent=2))
    else:
        for each in findings:
            typer.secho(
                "ok     " if not each.problem else "PROBLEM", fg="green" if not each.problem else "red", nl=False
            )
            typer.echo(f" {each.what}: {each.problem or each.told}".rstrip(": "))
    if any(finding.problem for finding in findings):
        raise typer.Exit(FAILED)
