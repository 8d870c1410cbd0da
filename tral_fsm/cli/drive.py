"""`tral drive`: a policy drives seeded courses; the results are numbers and pictures."""

from __future__ import annotations

import contextlib
import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tral_env.errors import ConfigError
from tral_env.perception import opengl
from tral_fsm.cli.console import FAILED
from tral_fsm.cli.terminal import print_figures
from tral_fsm.evaluation.choices import Camera, check_families
from tral_fsm.evaluation.files import prepare_folder, write_json
from tral_fsm.evaluation.host import versions

if TYPE_CHECKING:
    from collections.abc import Callable

    import gymnasium as gym

    from tral_env.interface import Policy
    from tral_fsm.evaluation.episode import Episode, Tick

_OWN_FILES = ("trajectory.png", "trace.csv", "drive.mp4", "drive.part.mp4")


@dataclass(frozen=True, kw_only=True)
class DriveArguments:
    """Options of `tral drive` but for the folder, as summary.json tells them."""

    scenario: str
    seed: int
    episodes: int
    policy: str
    camera: Camera
    randomization: str
    course: str | None
    video: bool
    lens: str = "default"
    trace: bool = False
    car: dict[str, float] = field(default_factory=dict)
    """Parameters of the car that are set, not drawn."""

    @property
    def name(self) -> str:
        """Name of the family or of the course."""
        return Path(self.course).stem if self.course else self.scenario

    @property
    def seeds(self) -> range:
        """A seed for each episode."""
        return range(self.seed, self.seed + self.episodes)


def command(
    scenario: Annotated[str, typer.Option(help="Family of courses; `tral courses` lists them.")] = "office",
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the first episode; each later episode has the next seed.")
    ] = 7,
    episodes: Annotated[int, typer.Option(min=1, help="Number of episodes.")] = 1,
    policy: Annotated[
        str,
        typer.Option(
            help="Name of a packaged machine, a machine file, the folder of a trained policy, or FILE.py:NAME for a "
            "policy of your own."
        ),
    ] = "office",
    camera: Annotated[
        Camera,
        typer.Option(
            help="Project the markers, as gym.make does by default, or render the camera's image: slower, needs OpenGL."
        ),
    ] = "projected",
    randomization: Annotated[
        str,
        typer.Option(
            help="How much cars and sensors differ from seed to seed: none, default, hard, or a file of ranges."
        ),
    ] = "default",
    car: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="A parameter of the car that is not drawn: friction=0.6. Repeatable."),
    ] = None,
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the files; it replaces those of an earlier drive.")
    ] = Path("runs/drive"),
    course: Annotated[
        str | None,
        typer.Option(help="Drive one course instead of a family: a name that `tral courses` lists, or a course file."),
    ] = None,
    video: Annotated[bool, typer.Option(help="Write drive.mp4, which needs OpenGL.")] = True,
    lens: Annotated[
        str, typer.Option(help="Lens of the camera: default, wide, or a camera_info file of `tral calibrate`.")
    ] = "default",
    trace: Annotated[
        bool, typer.Option("--trace", help="Write trace.csv: each tick, and why each transition fired.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print summary.json and nothing else; the files are written too.")
    ] = False,
) -> None:
    """Let a policy drive.

    The command writes summary.json, trajectory.png and drive.mp4 into the folder; of several episodes each has its
    pictures in a subfolder seed_N. The exit code is 0 if all episodes succeeded, else 1.
    """
    arguments = DriveArguments(
        scenario=scenario,
        seed=seed,
        episodes=episodes,
        policy=policy,
        camera=camera,
        randomization=randomization,
        course=course,
        video=video,
        lens=lens,
        trace=trace,
        car=car_parameters(car or []),
    )
    report = run(arguments, out)
    if as_json:
        typer.echo(json.dumps(report, indent=2))
    else:
        from tral_fsm.cli.show import table_of_episodes

        print_figures(table_of_episodes(report))
        typer.echo(f"Files: {out}")
    if report["figures"]["successes"] < episodes:
        raise typer.Exit(FAILED)


def run(arguments: DriveArguments, out: Path) -> dict[str, Any]:
    """Drive all episodes, and write the files of each as it ends.

    Args:
        arguments: the options.
        out: folder of the files.

    Returns:
        The content of summary.json.

    Raises:
        ConfigError: unknown scenario, policy or option, or a folder that cannot be written.
        PolicyError: the policy fails.
        RenderError: this computer has no OpenGL or no encoder for the pictures.
    """
    from tral_fsm.evaluation.own_policy import find_policy
    from tral_fsm.evaluation.summary import summarize

    opengl.require_loadable()
    policy = find_policy(arguments.policy)
    with contextlib.closing(make_env(arguments)) as env:
        _prepare(out)
        report: dict[str, Any] = {
            "complete": False,
            "arguments": asdict(arguments),
            "versions": versions(),
            "figures": summarize([]).record(),
            "episodes": [],
        }
        # The next drive knows the folder of a drive by this file, however this drive ends.
        write_json(out / "summary.json", report)
        for seed in arguments.seeds:
            folder = out if arguments.episodes == 1 else out / f"seed_{seed}"
            folder.mkdir(exist_ok=True)
            episode = _drive_one(env, policy, seed, folder, arguments)
            files = [str((folder / name).relative_to(out)) for name in _OWN_FILES if (folder / name).exists()]
            report["episodes"].append({**episode.record(), "files": files})
            report["figures"] = summarize(report["episodes"]).record()
            report["complete"] = seed == arguments.seeds[-1]
            write_json(out / "summary.json", report)
    return report


def car_parameters(given: list[str]) -> dict[str, float]:
    """Parameters of the car, from texts NAME=VALUE.

    Raises:
        ConfigError: a text has another form, or the car has no such parameter or may not have this value.
    """
    from tral_env.randomization import LEVELS

    values: dict[str, float] = {}
    for text in given:
        name, _, number = (part.strip() for part in text.partition("="))
        if name in values:
            raise ConfigError(f"--car {text}: {name} is set twice")
        try:
            values[name] = float(number)
            LEVELS["none"].fixed(**{name: values[name]})
        except ConfigError as error:
            raise ConfigError(f"--car {text}: {error}") from error
        except ValueError:
            raise ConfigError(f"--car {text}: expected NAME=VALUE with a number, such as friction=0.6") from None
    return values


def make_env(arguments: DriveArguments) -> gym.Env[Any, Any]:
    """The env of the arguments."""
    import gymnasium as gym

    check_families([arguments.scenario])
    return gym.make(
        "tral_env:TralCorridor-v0",
        scenario=arguments.scenario,
        camera=arguments.camera,
        randomization=arguments.randomization,
        course=arguments.course,
        lens=arguments.lens,
        render_mode="rgb_array" if arguments.video else None,
    )


def _prepare(out: Path) -> None:
    """Make the folder, and remove the files of an earlier drive, so that two drives do not mix."""
    prepare_folder(out)
    if (out / "summary.json").exists():
        for name in _OWN_FILES:
            for old in [out / name, *out.glob(f"seed_*/{name}")]:
                old.unlink(missing_ok=True)
        for folder in out.glob("seed_*/"):
            if not any(folder.iterdir()):
                folder.rmdir()
        (out / "summary.json").unlink()


def _drive_one(env: gym.Env[Any, Any], policy: Policy, seed: int, folder: Path, arguments: DriveArguments) -> Episode:
    from tral_fsm import MachinePolicy, load_machine
    from tral_fsm.cli.show import DriveProgress
    from tral_fsm.draw.panels import state_tones
    from tral_fsm.evaluation.rollout import drive
    from tral_fsm.report.drive.trace import TraceFile
    from tral_fsm.report.drive.trajectory import save_trajectory
    from tral_fsm.report.drive.video import DriveVideo

    world: Any = env.unwrapped
    tones = state_tones(policy.definition, load_machine) if isinstance(policy, MachinePolicy) else None
    with contextlib.ExitStack() as stack:
        watchers: list[Callable[[Tick], None]] = [stack.enter_context(DriveProgress(f"{arguments.name}, seed {seed}"))]
        if arguments.video:
            watchers.append(stack.enter_context(DriveVideo(folder / "drive.mp4", world, tones)))
        if arguments.trace:
            watchers.append(stack.enter_context(TraceFile(folder / "trace.csv")))

        def on_step(tick: Tick) -> None:
            for watch in watchers:
                watch(tick)

        options = {"car": arguments.car} if arguments.car else None
        episode = drive(env, policy, seed, options, on_step, scenario=arguments.name)
    save_trajectory(episode, world.plan, folder / "trajectory.png", tones)
    return episode
