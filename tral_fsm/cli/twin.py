"""`tral twin`: the simulated car behind real device files, in real time."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Annotated, Any, Literal

import typer

app = typer.Typer(no_args_is_help=True, help="Run the simulated car behind files that behave as the car's devices do.")

Name = Annotated[str, typer.Option(help="Name of the twin; several can run at once.")]
Board = Literal["pca9685", "sysfs-pwm", "board2016", "ucboard"]


@app.command("up")
def up(
    scenario: Annotated[str, typer.Option(help="Family of courses; `tral courses` lists them.")] = "office",
    course: Annotated[str | None, typer.Option(help="One course instead of a family: its name or its file.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Draws course, car, noise and the board's clock.")] = 7,
    randomization: Annotated[
        str, typer.Option(help="How much cars differ: none, default, hard, or a file of ranges.")
    ] = "default",
    oscillator: Annotated[
        float | None, typer.Option(help="Clock of the PWM board, Hz; without it, drawn from 24.0 to 28.7 MHz.")
    ] = None,
    board: Annotated[Board, typer.Option(help="Who is wired to servo and motor controller.")] = "pca9685",
    camera: Annotated[bool, typer.Option(help="Serve the camera's images, which needs OpenGL.")] = False,
    bus: Annotated[int, typer.Option(min=0, max=999, help="Number N of the bus: root gets /dev/i2c-N.")] = 7,
    view: Annotated[
        bool, typer.Option("--view", help="Show the car in the browser, as `tral live --twin` does.")
    ] = False,
    seconds: Annotated[float | None, typer.Option(help="The twin ends by itself after so long.")] = None,
    name: Name = "twin",
) -> None:
    """Run a twin until Ctrl-C or `tral twin down`."""
    from tral_env.twin.running import serve
    from tral_env.twin.settings import TwinSettings

    settings = TwinSettings(
        name=name,
        scenario=scenario,
        course=course,
        seed=seed,
        randomization=randomization,
        oscillator_hz=oscillator,
        board=board,
        camera=camera,
        bus=bus,
    )
    if view:
        from tral_fsm.live import require_viser

        require_viser()

    def ready(status: dict[str, Any]) -> None:
        _show_start(status)
        if view:
            _open_page(name)

    serve(settings, ready, seconds=seconds)


def _open_page(name: str) -> None:
    """Start `tral live --twin` as a process of its own, which ends with the twin and takes no time from it."""
    run = "import os; os.nice(10); from tral_fsm.cli import app; app()"
    subprocess.Popen([sys.executable, "-c", run, "live", "--twin", name], stdin=subprocess.DEVNULL)


@app.command("status")
def status(name: Name = "twin") -> None:
    """Print what a twin is and how it does, as JSON."""
    typer.echo(json.dumps(_ask(name, do="status"), indent=2))


@app.command("fault")
def fault(
    fault: Annotated[str, typer.Argument(help="Name of the fault, or `list`.", metavar="NAME")],
    rate: Annotated[float, typer.Option(help="Share of what fails, for faults that have one.")] = 0.1,
    seconds: Annotated[float | None, typer.Option(help="The fault ends by itself after so long.")] = None,
    after: Annotated[float, typer.Option(min=0.0, help="The fault begins in so many seconds.")] = 0.0,
    off: Annotated[bool, typer.Option("--off", help="End the fault.")] = False,
    name: Name = "twin",
) -> None:
    """Begin or end a fault of a running twin; `list` prints all faults."""
    if fault == "list":
        from tral_env.twin.faults import INJECTED_FAULTS

        for each, what in INJECTED_FAULTS.items():
            typer.echo(f"{each:17} {what.told}")
        return
    _ask(name, do="fault", name=fault, rate=rate, seconds=seconds, after=after, off=off)


@app.command("reset")
def reset(seed: Annotated[int, typer.Argument(min=0)], name: Name = "twin") -> None:
    """Put the car of a twin at the start of the course of a seed."""
    _ask(name, do="reset", seed=seed)


@app.command("down")
def down(name: Name = "twin") -> None:
    """End a twin."""
    _ask(name, do="down")


def _ask(twin: str, **request: Any) -> Any:
    from tral_env.twin.control import ask
    from tral_env.twin.settings import runtime_folder

    return ask(runtime_folder(twin), **request)


def _show_start(status: dict[str, Any]) -> None:
    rows = {
        "I2C bus": status["i2c"] or f"no file: {status['why_no_files']}",
        "clock of the PWM board": f"{status['oscillator_hz'] / 1e6:.3f} MHz",
        "hall sensor": status["hall"],
        **{f"serial port of {board}": path for board, path in status["serial"].items()},
        "camera": status["camera"] or "off: --camera",
    }
    for what, where in rows.items():
        typer.echo(f"{what}: {where}")
    typer.echo("The twin runs. Ctrl-C ends it.")
