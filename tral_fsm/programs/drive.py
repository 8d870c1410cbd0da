"""A policy drives seeded courses; summary.json and pictures of each episode are kept in a folder.

Heavy modules are imported when the program runs, because `tral --help` imports its arguments.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tral_env.perception import opengl
from tral_env.recording.about import versions
from tral_fsm.evaluation.choices import Camera, check_families
from tral_fsm.evaluation.files import prepare_folder, write_json

if TYPE_CHECKING:
    import gymnasium as gym

    from tral_env.interface import Policy
    from tral_fsm.evaluation.episode import Episode, Tick
    from tral_fsm.evaluation.recording import DriveRecorder

SUMMARY = "summary.json"
"""The file of the numbers; a folder that holds it is the folder of a drive."""
RECORDING = "drive.mcap"
"""The file of a recorded episode."""
_PICTURES = ("trajectory.png", "trace.csv", RECORDING, "drive.mp4", "drive.part.mp4")
"""Files of an episode."""


@dataclass(frozen=True, kw_only=True)
class DriveArguments:
    """What is driven and drawn, as summary.json tells it."""

    scenario: str
    """Family of the courses."""
    seed: int
    """Seed of the first episode; each later episode has the next seed."""
    episodes: int
    policy: str
    """Name of a packaged machine, path of a machine file, or FILE.py:NAME."""
    camera: Camera
    randomization: str
    """Name of a level, or path of a file of ranges."""
    course: str | None
    """Name or path of the one course that is driven instead of a family."""
    video: bool
    """Whether drive.mp4 is written."""
    lens: str = "default"
    trace: bool = False
    """Whether trace.csv is written."""
    record: bool = False
    """Whether drive.mcap is written."""
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


Progress = Callable[[str], "AbstractContextManager[Callable[[Tick], None]]"]
"""Shows an episode of this name while it runs, tick by tick."""


def run(arguments: DriveArguments, out: Path, progress: Progress) -> dict[str, Any]:
    """Drive all episodes, and write the files of each as it ends.

    Args:
        arguments: what is driven and drawn.
        out: folder of the files; those of an earlier drive are removed.
        progress: shows each episode while it runs.

    Returns:
        The content of summary.json.

    Raises:
        ConfigError: unknown scenario, policy or option, or a folder that cannot be written.
        PolicyError: the policy fails.
        RenderError: this computer has no OpenGL or no encoder for the pictures.
    """
    opengl.require_loadable()
    from tral_fsm.evaluation.own_policy import find_policy
    from tral_fsm.evaluation.summary import summarize

    policy = find_policy(arguments.policy)
    with contextlib.closing(_make_env(arguments)) as env:
        _prepare(out)
        report: dict[str, Any] = {
            "complete": False,
            "arguments": asdict(arguments),
            "versions": versions(),
            "figures": summarize([]).record(),
            "episodes": [],
        }
        # The next drive knows the folder of a drive by this file, however this drive ends.
        write_json(out / SUMMARY, report)
        for seed in arguments.seeds:
            folder = out if arguments.episodes == 1 else out / f"seed_{seed}"
            folder.mkdir(exist_ok=True)
            episode = _drive_one(env, policy, seed, folder, arguments, progress)
            files = [str((folder / name).relative_to(out)) for name in _PICTURES if (folder / name).exists()]
            report["episodes"].append({**episode.record(), "files": files})
            report["figures"] = summarize(report["episodes"]).record()
            report["complete"] = seed == arguments.seeds[-1]
            write_json(out / SUMMARY, report)
    return report


def _make_env(arguments: DriveArguments) -> gym.Env[Any, Any]:
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
    if (out / SUMMARY).exists():
        for name in _PICTURES:
            for old in [out / name, *out.glob(f"seed_*/{name}")]:
                old.unlink(missing_ok=True)
        for folder in out.glob("seed_*/"):
            if not any(folder.iterdir()):
                folder.rmdir()
        (out / SUMMARY).unlink()


def _drive_one(
    env: gym.Env[Any, Any], policy: Policy, seed: int, folder: Path, arguments: DriveArguments, progress: Progress
) -> Episode:
    from tral_fsm import MachinePolicy, load_machine
    from tral_fsm.draw.panels import state_tones
    from tral_fsm.evaluation.rollout import drive
    from tral_fsm.report.drive.trace import TraceFile
    from tral_fsm.report.drive.trajectory import save_trajectory
    from tral_fsm.report.drive.video import DriveVideo

    world: Any = env.unwrapped
    tones = state_tones(policy.definition, load_machine) if isinstance(policy, MachinePolicy) else None
    with contextlib.ExitStack() as stack:
        watchers: list[Callable[[Tick], None]] = [stack.enter_context(progress(f"{arguments.name}, seed {seed}"))]
        if arguments.video:
            watchers.append(stack.enter_context(DriveVideo(folder / "drive.mp4", world, tones)))
        if arguments.trace:
            watchers.append(stack.enter_context(TraceFile(folder / "trace.csv")))
        if arguments.record:
            watchers.append(stack.enter_context(_recorder(env, policy, seed, folder, arguments)))

        def on_step(tick: Tick) -> None:
            for watch in watchers:
                watch(tick)

        options = {"car": arguments.car} if arguments.car else None
        episode = drive(env, policy, seed, options, on_step, scenario=arguments.name)
        # The last frames of the video are rendered meanwhile.
        save_trajectory(episode, world.plan, folder / "trajectory.png", tones)
    return episode


def _recorder(
    env: gym.Env[Any, Any], policy: Policy, seed: int, folder: Path, arguments: DriveArguments
) -> DriveRecorder:
    from tral_fsm.evaluation.policy_files import files_of_policy
    from tral_fsm.evaluation.recording import DriveRecorder

    return DriveRecorder(
        folder / RECORDING,
        env,
        seed=seed,
        scenario=arguments.name,
        policy=arguments.policy,
        files=files_of_policy(arguments.policy, policy),
    )
