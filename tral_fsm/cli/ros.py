"""`tral ros`: the car, its camera and its policy as nodes of ROS 2."""

from __future__ import annotations

import inspect
import logging
import signal
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperCommand

from tral_fsm.programs.ros.asked import Asked

app = typer.Typer(no_args_is_help=True, help="Run the car, its camera and its policy as nodes of ROS 2, without ROS.")

OPTIONS: dict[str, Any] = {
    "backend": Annotated[Literal["simulation", "twin", "car"], typer.Option(help="Which car.")],
    "config": Annotated[str, typer.Option(help="Car file of the backend `car`.")],
    "dry": Annotated[bool, typer.Option("--dry", help="Record the pulses of the real car and send none.")],
    "scenario": Annotated[str, typer.Option(help="Family of courses; `tral courses` lists them.")],
    "course": Annotated[str | None, typer.Option(help="One course instead of a family: its name or its file.")],
    "seed": Annotated[int, typer.Option(min=0, help="Draws course, car and noise.")],
    "randomization": Annotated[
        str, typer.Option(help="How much cars differ: none, default, hard, or a file of ranges.")
    ],
    "camera": Annotated[
        Literal["projected", "rendered"],
        typer.Option(help="Whether a simulated car tells what it sees itself, or serves images to the node `camera`."),
    ],
    "namespace": Annotated[str, typer.Option(help="Before all topics, such as /car1.")],
    "use_sim_time": Annotated[
        bool, typer.Option("--use-sim-time", help="Stamps are the simulated time, as /clock tells it.")
    ],
    "lock_step": Annotated[
        bool, typer.Option("--lock-step", help="Each tick waits for its answer, not for the clock on the wall.")
    ],
    "arm": Annotated[
        bool, typer.Option("--arm", help="Arm at the start, without a message. Nobody may be near a real car.")
    ],
    "command_timeout": Annotated[float, typer.Option(help="A command may be so old, s; then the car stops.")],
    "camera_timeout": Annotated[
        float, typer.Option(help="The camera may be silent for so long, s; then the car stops.")
    ],
    "policy": Annotated[str, typer.Option(help="Machine, trained policy, or FILE.py:NAME.")],
    "source": Annotated[str, typer.Option(help="Number, path or URL of the camera; without it, that of the backend.")],
}
"""Name of each parameter -> its option; its default is that of `Asked`."""
NODES: dict[str, tuple[str, ...]] = {
    "car": (
        "backend", "config", "dry", "scenario", "course", "seed", "randomization", "camera", "namespace",
        "use_sim_time", "lock_step", "arm", "command_timeout",
    ),
    "camera": ("backend", "config", "source", "namespace"),
    "fsm": ("policy", "namespace", "use_sim_time", "camera_timeout"),
}  # fmt: skip
"""Name of each node -> its parameters."""


_REFUSED = {"arm": "a file arms no car: a person does, by true on the topic arm, or by --arm"}
"""Parameter that no file may give -> why."""


class _NodeCommand(TyperCommand):
    """A command that takes the parameters of its nodes from a file of ROS; options of the command line count more."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Let the file be the defaults."""
        given, _, _ = self.make_parser(ctx).parse_args(list(args))
        if (path := given.get("params_file")) and not ctx.resilient_parsing:
            from tral_env.ros.parameters import read_parameters

            nodes = [self.name] if self.name in NODES else list(NODES)
            ctx.default_map = read_parameters(Path(path), NODES, nodes, given.get("namespace"), _REFUSED)
        return super().parse_args(ctx, args)


def _command(name: str, text: str, options: Iterable[str], run: Callable[[Asked, threading.Event], None]) -> None:
    """Add a command that runs nodes until a signal ends them."""

    def command(params_file: Path | None, **given: Any) -> None:
        _require_dds()
        run(Asked(**given), _until_stopped())

    kind, defaults = inspect.Parameter.KEYWORD_ONLY, Asked()
    taken = [
        inspect.Parameter(each, kind, default=getattr(defaults, each), annotation=OPTIONS[each]) for each in options
    ]
    file = Annotated[
        Path | None,
        typer.Option(help="Parameters as a file of ROS 2, as a launch has it."),
    ]
    taken.append(inspect.Parameter("params_file", kind, default=None, annotation=file))
    command.__signature__ = inspect.Signature(taken)  # type: ignore[attr-defined]
    command.__annotations__ = {each.name: each.annotation for each in taken}
    app.command(name, cls=_NodeCommand, help=text)(command)


def _require_dds() -> None:
    try:
        import cyclonedds  # noqa: F401
    except ImportError as error:
        from tral_env.errors import MissingExtraError

        raise MissingExtraError("cyclonedds", "ros", "tral ros") from error


def _until_stopped() -> threading.Event:
    """An event that a signal sets; until then the nodes tell on stderr what they tell on /rosout."""
    logging.basicConfig(format="[%(levelname)s] [%(name)s]: %(message)s")
    logging.getLogger("tral.ros").setLevel(logging.INFO)
    ended = threading.Event()
    numbers = [signal.SIGINT, signal.SIGTERM]
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as nohup leaves it
        numbers.append(signal.SIGHUP)
    for number in numbers:
        signal.signal(number, lambda *_: ended.set())
    return ended


def _car(asked: Asked, ended: threading.Event) -> None:
    from tral_fsm.programs.ros.nodes import car_node

    car_node(asked).run(ended)


def _camera(asked: Asked, ended: threading.Event) -> None:
    from tral_fsm.programs.ros.nodes import camera_node

    camera_node(asked).run(ended)


def _fsm(asked: Asked, ended: threading.Event) -> None:
    from tral_fsm.programs.ros.nodes import fsm_node

    fsm_node(asked).run(ended)


def _up(asked: Asked, ended: threading.Event) -> None:
    from tral_fsm.programs.ros.nodes import camera_node, car_node, fsm_node, has_images, run_all

    others = [fsm_node(asked).run]
    if has_images(asked):
        others.append(camera_node(asked).run)
    run_all([car_node(asked).run, *others], ended)  # the car last: it is opened when all else is in order


_command("car", "Run the node `car`: readings out, commands in.", NODES["car"], _car)
_command(
    "camera", "Run the node `camera`: images, lens, and the gates and markers that they show.", NODES["camera"], _camera
)
_command("fsm", "Run the node `fsm`: a policy, with readings in and commands out.", NODES["fsm"], _fsm)
_command("up", "Run all nodes in one process; the node `camera` only where there are images.", OPTIONS, _up)


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
