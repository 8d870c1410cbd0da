"""The `tral` command: drives, cars, machines, tuning, training, calibration, printing, speed; `tral --help` lists all.

Each subcommand has a file; heavy modules are imported when a command needs them.
"""

from __future__ import annotations

from typing import Annotated

import typer

from tral_fsm.cli.bench import app as bench_app
from tral_fsm.cli.calibrate import command as calibrate_command
from tral_fsm.cli.car import app as car_app
from tral_fsm.cli.compare import command as compare_command
from tral_fsm.cli.console import Guarded, takes
from tral_fsm.cli.courses import command as courses_command
from tral_fsm.cli.deploy import command as deploy_command
from tral_fsm.cli.detect import command as detect_command
from tral_fsm.cli.doctor import command as doctor_command
from tral_fsm.cli.drive import command as drive_command
from tral_fsm.cli.fsm import app as fsm_app
from tral_fsm.cli.live import command as live_command
from tral_fsm.cli.print import app as print_app
from tral_fsm.cli.replay import command as replay_command
from tral_fsm.cli.ros import app as ros_app
from tral_fsm.cli.teleop import command as teleop_command
from tral_fsm.cli.train import command as train_command
from tral_fsm.cli.tune import command as tune_command
from tral_fsm.cli.twin import app as twin_app

app = typer.Typer(
    name="tral",
    cls=Guarded,
    no_args_is_help=True,
    pretty_exceptions_show_locals=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit codes: 0 success, 1 an episode failed or a file is bad, 2 bad usage, 3 the computer lacks something.",
)
app.command("drive", cls=takes("--policy"))(drive_command)
app.command("live", cls=takes("--policy"))(live_command)
app.command("deploy", cls=takes("--policy"))(deploy_command)
app.command("teleop")(teleop_command)
app.command("replay")(replay_command)
app.command("courses", cls=takes("--course"))(courses_command)
app.command("compare", cls=takes("--policies"))(compare_command)
app.command("tune", cls=takes("--policy"))(tune_command)
app.command("train", cls=takes("--scenario"))(train_command)
app.command("calibrate")(calibrate_command)
app.command("detect")(detect_command)
app.command("doctor")(doctor_command)
app.add_typer(car_app, name="car")
app.add_typer(fsm_app, name="fsm")
app.add_typer(print_app, name="print")
app.add_typer(bench_app, name="bench")
app.add_typer(twin_app, name="twin")
app.add_typer(ros_app, name="ros")


def _show_version(wanted: bool) -> None:
    if wanted:
        from tral_env import __version__

        typer.echo(f"tral {__version__}")
        raise typer.Exit


@app.callback()
def main(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Small Ackermann cars in corridors: drive them, tune machines, train networks, calibrate cameras, see markers."""
