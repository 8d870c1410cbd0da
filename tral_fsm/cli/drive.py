"""`tral drive`: a policy drives seeded courses; the results are numbers and pictures."""

from __future__ import annotations

import contextlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tral_env.perception import opengl
from tral_fsm.cli.console import FAILED
from tral_fsm.cli.terminal import print_figures
from tral_fsm.evaluation.choices import Camera, Randomization, check_families
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
    randomization: Randomization
    course: str | None
    video: bool
    lens: str = "default"
    trace: bool = False

    @property
    def name(self) -> str:
        """Name of the family, or of the course file."""
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
    policy: Annotated[str, typer.Option(help="Name of a packaged machine, or a machine file.")] = "office",
    camera: Annotated[
        Camera, typer.Option(help="Render the camera's image, or project the markers: faster, without OpenGL.")
    ] = "rendered",
    randomization: Annotated[
        Randomization, typer.Option(help="How much cars and sensors differ from seed to seed.")
    ] = "default",
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the files; it replaces those of an earlier drive.")
    ] = Path("runs/drive"),
    course: Annotated[
        Path | None, typer.Option(exists=True, dir_okay=False, help="Drive this course file instead of a family.")
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
        course=str(course) if course else None,
        video=video,
        lens=lens,
        trace=trace,
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
        RenderError: this computer has no OpenGL or no encoder for the pictures.
    """
    from tral_fsm import load_policy
    from tral_fsm.evaluation.summary import summarize

    opengl.require_loadable()
    policy = load_policy(arguments.policy)
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
    from tral_fsm.cli.show import DriveProgress
    from tral_fsm.evaluation.rollout import drive
    from tral_fsm.report.drive.trace import TraceFile
    from tral_fsm.report.drive.trajectory import save_trajectory
    from tral_fsm.report.drive.video import DriveVideo

    world: Any = env.unwrapped
    with contextlib.ExitStack() as stack:
        watchers: list[Callable[[Tick], None]] = [stack.enter_context(DriveProgress(f"{arguments.name}, seed {seed}"))]
        if arguments.video:
            watchers.append(stack.enter_context(DriveVideo(folder / "drive.mp4", world)))
        if arguments.trace:
            watchers.append(stack.enter_context(TraceFile(folder / "trace.csv")))

        def on_step(tick: Tick) -> None:
            for watch in watchers:
                watch(tick)

        episode = drive(env, policy, seed, on_step=on_step, scenario=arguments.name)
    save_trajectory(episode, world.plan, folder / "trajectory.png")
    return episode
