"""`tral deploy`: a policy drives the real car."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tral_fsm.cli import hands
from tral_fsm.cli.drive_options import Policy
from tral_fsm.programs.cockpit import Cockpit
from tral_fsm.programs.deploy import DeployArguments, run

Config = Annotated[str, typer.Option(help="Car file, as `tral car init` writes it.")]
Dry = Annotated[bool, typer.Option("--dry", help="Record the pulses and send none; no motor moves.")]
Arm = Annotated[bool, typer.Option("--arm", help="Drive at once, without an act of a person. Nobody may be near.")]
Seconds = Annotated[float, typer.Option(min=0.1, help="The drive ends after this time, s.")]
Out = Annotated[Path, typer.Option(file_okay=False, help="Folder of the files; it replaces those of an earlier drive.")]
Record = Annotated[bool, typer.Option(help="Write drive.mcap.")]
View = Annotated[bool, typer.Option("--view", help="Show the drive in the browser, with a stop (extra `live`).")]
Host = Annotated[str, typer.Option(help="Address that the page listens on; other than this, its link has a token.")]
Port = Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; if it is taken, the next free one.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print summary.json and nothing else on stdout.")]


def command(
    policy: Policy,
    config: Config = "car.toml",
    dry: Dry = False,
    arm: Arm = False,
    gamepad: hands.Gamepad = False,
    gamepad_file: hands.GamepadFile = None,
    seconds: Seconds = 60.0,
    out: Out = Path("runs/deploy"),
    record: Record = True,
    view: View = False,
    host: Host = "127.0.0.1",
    port: Port = 8080,
    as_json: AsJson = False,
) -> None:
    """Let a policy drive the real car.

    The pre-flight asks each sensor; a key or a button arms; then any other key, the gamepad's B, and letting go of its
    LB stop the car, as SIGINT, SIGTERM and SIGHUP do. The exit code is 0 if the drive ended as somebody wished, else 1.
    """
    arguments = DeployArguments(
        policy=policy, config=config, dry=dry, arm=arm, max_duration_s=seconds, record=record,
        view=view, host=host, port=port,
    )  # fmt: skip
    drive(arguments, out, gamepad, gamepad_file, as_json)


def drive(
    arguments: DeployArguments,
    out: Path,
    gamepad: bool = False,
    gamepad_file: str | None = None,
    as_json: bool = False,
) -> None:
    """Drive with what the terminal and a gamepad give a person, and tell how the drive ended."""
    from tral_fsm.teleop.keyboard import StopKeys

    has_pad = gamepad or gamepad_file is not None
    with hands.devices(gamepad, gamepad_file, StopKeys) as devices:
        cockpit = Cockpit(out=out, devices=devices, console=hands.TerminalConsole(), must_hold=has_pad)
        report = run(arguments, cockpit)
    hands.tell(report, out, as_json)
