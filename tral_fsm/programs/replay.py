"""A recorded drive again: its table and picture, the simulated car on its commands, another policy's answers, exports.

Heavy modules are imported when the program runs, because `tral --help` imports its arguments.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from tral_env.errors import ConfigError
from tral_fsm.evaluation.files import prepare_folder, write_json

if TYPE_CHECKING:
    from tral_env.recording.read import Recording

SUMMARY = "replay.json"
"""The file of the numbers."""
Format = Literal["csv", "lerobot", "mcap"]


@dataclass(frozen=True, kw_only=True)
class ReplayArguments:
    """What is made of a recording."""

    file: Path
    against_simulation: bool = False
    """Whether the recorded commands drive the simulated car, too."""
    course: str | None = None
    """Name or path of the course that was driven; None: the one that the recording keeps."""
    policy: str | None = None
    """A policy that answers each recorded observation."""
    video: bool = False
    """Whether replay.mp4 is written."""
    to: tuple[Format, ...] = ()
    """Other formats that are written."""


def run(arguments: ReplayArguments, out: Path, on_tick: Callable[[int], None] = lambda tick: None) -> dict[str, Any]:
    """Read a recording, and write what is wanted of it.

    Args:
        arguments: what is wanted.
        out: folder of the files.
        on_tick: called with the number of each simulated tick.

    Returns:
        The content of replay.json.

    Raises:
        ConfigError: the file, the folder or the course is missing.
        BadFileError: the file is no recording, or holds no tick.
        MissingExtraError: pyarrow is not installed.
        PolicyError: the policy fails.
        RenderError: this computer has no OpenGL or no encoder for the video.
    """
    from tral_env.recording.read import read
    from tral_fsm.evaluation.measured import figures

    recording = read(arguments.file)
    prepare_folder(out)
    report: dict[str, Any] = {"file": str(arguments.file), **figures(recording), "episode": None}
    if len(recording.tick):
        report["episode"] = _draw(recording, out / "trajectory.png")
    if arguments.against_simulation:
        report["against_simulation"] = _against(recording, arguments.course, out, on_tick)
    if arguments.policy is not None:
        report["policy"] = _open_loop(recording, arguments.policy, out)
    if arguments.video:
        from tral_fsm.programs.replay_video import write_video

        write_video(recording, out / "replay.mp4", arguments.course)
    for name in arguments.to:
        _export(recording, name, out)
    write_json(out / SUMMARY, report)
    return report


def _draw(recording: Recording, path: Path) -> dict[str, Any] | None:
    """Draw the drive; gives the record of the episode, where the ground truth tells one."""
    from tral_env.course.geometry import build_plan
    from tral_fsm.evaluation.measured import figures, measured_trace
    from tral_fsm.evaluation.recording import course_of, episode_of
    from tral_fsm.report.drive.trajectory import save_recorded, save_trajectory

    tones, course = _tones(recording), course_of(recording)
    if recording.source == "simulation" and course is not None:
        episode = episode_of(recording)
        save_trajectory(episode, build_plan(course), path, tones)
        return episode.record()
    told = figures(recording)
    heading = (
        f"{recording.path.name}: {told['distance_m']:.1f} m in {told['time_s']:.1f} s, "
        f"{told['late_ticks']} late ticks   (the path is dead reckoning)"
    )
    save_recorded(measured_trace(recording), heading, path, tones)
    return None


def _tones(recording: Recording) -> dict[str, str] | None:
    """Colours of the states of the machine that the recording keeps."""
    from tral_fsm import load_machine
    from tral_fsm.draw.panels import state_tones
    from tral_fsm.evaluation.recording import machine_of

    machine = machine_of(recording)
    return None if machine is None else state_tones(machine, load_machine)


def _against(recording: Recording, course: str | None, out: Path, on_tick: Callable[[int], None]) -> dict[str, Any]:
    from tral_fsm.evaluation.replay import against_simulation
    from tral_fsm.report.drive.residuals import save_residuals

    comparison = against_simulation(recording, course, on_tick)
    save_residuals(comparison, out / "residuals.png")
    comparison.write_csv(out / "residuals.csv")
    return {"ended": comparison.outcome, "residuals": comparison.record()}


def _open_loop(recording: Recording, source: str, out: Path) -> dict[str, Any]:
    from tral_fsm.evaluation.own_policy import find_policy
    from tral_fsm.evaluation.replay import open_loop

    answers = open_loop(recording, find_policy(source), source)
    answers.write_csv(out / "policy.csv")
    return {"policy": source, **answers.record()}


def _export(recording: Recording, name: Format, out: Path) -> None:
    if name == "csv":
        from tral_env.recording.table import write_csv

        write_csv(recording, out / "drive.csv")
    elif name == "lerobot":
        from tral_env.recording.lerobot import write_dataset

        write_dataset([recording], out / "lerobot")
    elif name == "mcap":
        from tral_env.recording.mend import mend

        mend(recording.path, out / "drive.mcap")
    else:
        raise ConfigError(f"to = {name!r}. Allowed: csv, lerobot, mcap")
