"""`tral ros`: the car, its camera and its policy as nodes of ROS 2."""

from __future__ import annotations

import logging
import signal
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tral_env.errors import ConfigError

if TYPE_CHECKING:
    from tral_fsm.programs.ros.nodes import Asked

app = typer.Typer(no_args_is_help=True, help="Run the car, its camera and its policy as nodes of ROS 2, without ROS.")


def _parameters(context: typer.Context, path: Path | None) -> Path | None:
    """Take the parameters of a node from a file of ROS; options of the command line count more."""
    if path is not None:
        from tral_env.ros.parameters import read_parameters

        given = read_parameters(path, context.command.name or "")
        known = {parameter.name for parameter in context.command.params}
        for name in given:
            if name not in known:
                raise ConfigError(f"{path}: unknown parameter '{name}'. Allowed: {', '.join(sorted(known))}")
        context.default_map = given
    return path


Backend = Annotated[Literal["simulation", "twin", "car"], typer.Option(help="Which car.")]
Config = Annotated[str, typer.Option(help="Car file of the backend `car`.")]
Dry = Annotated[bool, typer.Option("--dry", help="Record the pulses of the real car and send none.")]
Scenario = Annotated[str, typer.Option(help="Family of courses; `tral courses` lists them.")]
OneCourse = Annotated[str | None, typer.Option(help="One course instead of a family: its name or its file.")]
Seed = Annotated[int, typer.Option(min=0, help="Draws course, car and noise.")]
Level = Annotated[str, typer.Option(help="How much cars differ: none, default, hard, or a file of ranges.")]
Sight = Annotated[
    Literal["projected", "rendered"],
    typer.Option(help="Whether a simulated car tells what it sees itself, or serves images to the node `camera`."),
]
Namespace = Annotated[str, typer.Option(help="Before all topics, such as /car1.")]
SimTime = Annotated[bool, typer.Option("--use-sim-time", help="Stamps are the simulated time, as /clock tells it.")]
LockStep = Annotated[
    bool, typer.Option("--lock-step", help="Each tick waits for its answer, not for the clock on the wall.")
]
Arm = Annotated[bool, typer.Option("--arm", help="Arm at the start, without a message. Nobody may be near a real car.")]
CommandTimeout = Annotated[float, typer.Option(help="A command may be so old, s; then the car stops.")]
CameraTimeout = Annotated[float, typer.Option(help="The camera may be silent for so long, s; then the car stops.")]
Policy = Annotated[str, typer.Option(help="Machine, trained policy, or FILE.py:NAME.")]
Source = Annotated[str, typer.Option(help="Number, path or URL of the camera; without it, that of the backend.")]
Parameters = Annotated[
    Path | None,
    typer.Option("--params-file", callback=_parameters, is_eager=True, help="Parameters as a file of ROS."),
]


def _asked(given: dict[str, Any]) -> Asked:
    """The options of a command, all but the file of parameters."""
    _require_dds()
    from tral_fsm.programs.ros.nodes import Asked

    return Asked(**{name: value for name, value in given.items() if name != "params_file"})


def _require_dds() -> None:
    try:
        import cyclonedds  # noqa: F401
    except ImportError as error:
        from tral_env.errors import MissingExtraError

        raise MissingExtraError("cyclonedds", "ros", "tral ros") from error


def _until_stopped() -> threading.Event:
    """An event that a signal sets; until then the nodes tell on stderr what they tell on /rosout."""
    logging.basicConfig(level=logging.INFO, format="[%(levelname)s] [%(name)s]: %(message)s")
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    return ended


@app.command("car")
def car(
    backend: Backend = "simulation",
    config: Config = "car.toml",
    dry: Dry = False,
    scenario: Scenario = "office",
    course: OneCourse = None,
    seed: Seed = 7,
    randomization: Level = "default",
    camera: Sight = "projected",
    namespace: Namespace = "",
    use_sim_time: SimTime = False,
    lock_step: LockStep = False,
    arm: Arm = False,
    command_timeout: CommandTimeout = 0.15,
    params_file: Parameters = None,
) -> None:
    """Run the node `car`: readings out, commands in."""
    asked = _asked(locals())
    from tral_fsm.programs.ros.nodes import car_node

    car_node(asked).run(_until_stopped())


@app.command("camera")
def camera(
    backend: Backend = "simulation",
    config: Config = "car.toml",
    source: Source = "",
    namespace: Namespace = "",
    params_file: Parameters = None,
) -> None:
    """Run the node `camera`: images, lens, and the gates and markers that they show."""
    asked = _asked(locals())
    from tral_fsm.programs.ros.nodes import camera_node

    camera_node(asked).run(_until_stopped())


@app.command("fsm")
def fsm(
    policy: Policy = "office",
    namespace: Namespace = "",
    use_sim_time: SimTime = False,
    camera_timeout: CameraTimeout = 0.3,
    params_file: Parameters = None,
) -> None:
    """Run the node `fsm`: a policy, with readings in and commands out."""
    asked = _asked(locals())
    from tral_fsm.programs.ros.nodes import fsm_node

    fsm_node(asked).run(_until_stopped())


@app.command("up")
def up(
    policy: Policy = "office",
    backend: Backend = "simulation",
    config: Config = "car.toml",
    dry: Dry = False,
    scenario: Scenario = "office",
    course: OneCourse = None,
    seed: Seed = 7,
    randomization: Level = "default",
    camera: Sight = "projected",
    namespace: Namespace = "",
    use_sim_time: SimTime = False,
    lock_step: LockStep = False,
    arm: Arm = False,
    command_timeout: CommandTimeout = 0.15,
    camera_timeout: CameraTimeout = 0.3,
) -> None:
    """Run all nodes in one process; the node `camera` only where there are images."""
    asked = _asked(locals())
    from tral_fsm.programs.ros.nodes import camera_node, car_node, fsm_node, has_images, run_all

    others = [fsm_node(asked).run]
    if has_images(asked):
        others.append(camera_node(asked).run)
    run_all([car_node(asked).run, *others], _until_stopped())  # the car last: it is opened when all else is in order


@app.command("bag")
def bag(
    recording: Annotated[Path, typer.Argument(help="Recording, as `tral drive --record` writes it.")],
    out: Annotated[Path, typer.Option(help="The MCAP file.")] = Path("drive-ros2.mcap"),
) -> None:
    """Write a recorded drive as an MCAP file of ROS 2: for `ros2 bag`, Foxglove, PlotJuggler."""
    _require_dds()
    from tral_env.recording.read import read
    from tral_env.ros.bag import write_bag

    count = write_bag(read(recording), out)
    typer.echo(f"{out}: {count} messages")
