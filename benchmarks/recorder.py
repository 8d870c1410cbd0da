"""What does recording cost the control loop, how large are the files, and what does a kill lose?

A machine drives a simulated course; what it was told and answered is then recorded at 80 ticks a second by the clock.

1. Time of a call of `Recorder.tick` in the loop, lateness of the loop with and without a recorder, processor time.
2. Size of a minute, with and without images.
3. A process that records is killed (`kill -9`) at random moments. Which ticks that it had handed over are in the file?

    python benchmarks/recorder.py [--seconds 30] [--kills 50] [--no-images] [--seed 0] [--out FILE]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from tral_env.errors import BadFileError
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.recording.read import read
from tral_env.recording.recorder import Recorder
from tral_fsm import load_policy
from tral_fsm.evaluation.files import prepare_folder, write_json
from tral_fsm.evaluation.host import host

RESULTS = Path(__file__).parent / "results" / "recorder.json"
IMAGE_EVERY = 5
"""An image comes every so many ticks: 16 in a second."""
MAX_RUN_S = 3.0
"""A process lives so long at most before it is killed."""


def driven(seconds: float, images: bool) -> dict[str, NDArray[Any]]:
    """Observations and actions of a drive, and some images of its camera."""
    env, policy = gym.make("tral_env:TralCorridor-v0", scenario="gates", max_episode_steps=10**6), load_policy("gate")
    told, _ = env.reset(seed=7)
    rows, answers, pictures = [], [], []
    for k in range(round(seconds / CONTROL_PERIOD_S)):
        action = policy.act(told)
        rows.append(told)
        answers.append(action)
        if images and k % (8 * IMAGE_EVERY) == 0:
            pictures.append(env.unwrapped.render_view("onboard", 640, 480))
        told, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            told, _ = env.reset(seed=7)
            policy.reset()
    env.close()
    return {"rows": np.array(rows), "answers": np.array(answers), "images": np.array(pictures, np.uint8)}


def pace(drive: dict[str, NDArray[Any]], recorder: Recorder | None, tell: bool = False) -> dict[str, NDArray[Any]]:
    """Go through a drive by the clock; gives the time of each call and the lateness of each tick, s.

    Args:
        drive: what `driven` gave.
        recorder: records it; None: nothing does.
        tell: whether the number of each tick that was handed over is printed.
    """
    images, costs, lateness = drive["images"], [], []
    deadline_s = time.monotonic()
    for k, (row, action) in enumerate(zip(drive["rows"], drive["answers"], strict=True)):
        deadline_s += CONTROL_PERIOD_S
        time.sleep(max(0.0, deadline_s - time.monotonic()))
        lateness.append(time.monotonic() - deadline_s)
        if recorder is None:
            continue
        begin = time.perf_counter()
        recorder.tick(
            time_s=deadline_s, observation=row, action=action, applied=(0.1, 0.2), pulses_us=(1510.0, 1590.0),
            state="follow", wanted=(1.0, 0.5),
        )  # fmt: skip
        costs.append(time.perf_counter() - begin)
        if len(images) and k % IMAGE_EVERY == 0:
            recorder.image(deadline_s, images[k // IMAGE_EVERY % len(images)])
        if tell:
            print(k, flush=True)
    return {"cost_s": np.array(costs), "lateness_s": np.array(lateness)}


def cost(drive: dict[str, NDArray[Any]], folder: Path, name: str) -> dict[str, Any]:
    """Time, size and lateness of a recording, or of a loop that records nothing."""
    path, seconds = folder / f"{name}.mcap", len(drive["rows"]) * CONTROL_PERIOD_S
    with nullcontext() if name == "nothing" else Recorder(path, start_s=time.monotonic()) as recorder:
        begin = time.process_time()
        found = pace(drive, recorder)
        used = time.process_time() - begin
        dropped = 0 if recorder is None else recorder.dropped
    told: dict[str, Any] = {"cpu_share": used / seconds, "dropped": dropped}
    for what, values in found.items():
        if len(values):
            median, p99, largest = (1e6 * np.percentile(values, share) for share in (50, 99, 100))
            told[what.replace("_s", "_us")] = {"median": median, "p99": p99, "largest": largest}
    if path.exists():
        told["mb_per_minute"] = path.stat().st_size / 1e6 / (seconds / 60)
    return told


def kill(drive_file: Path, folder: Path, after_s: float) -> dict[str, Any]:
    """Let a process record, kill it after some time, and read what is there."""
    path = folder / "killed.mcap"
    path.unlink(missing_ok=True)
    command = [sys.executable, __file__, "--child", str(path), "--drive", str(drive_file)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        handed = [child.stdout.readline()]
        time.sleep(after_s)
        child.kill()
        handed += child.stdout.readlines()
    last = int([line for line in handed if line.endswith("\n")][-1])
    try:
        kept = int(read(path).tick[-1]) if len(read(path).tick) else -1
    except BadFileError as error:
        return {"after_s": after_s, "unreadable": str(error)}
    return {"after_s": after_s, "ticks": last + 1, "lost_s": (last - kept) * CONTROL_PERIOD_S}


def kills(drive: dict[str, NDArray[Any]], folder: Path, count: int, seed: int) -> dict[str, Any]:
    """Kill a recording process at random moments."""
    drive_file = folder / "drive.npz"
    np.savez(drive_file, **{**drive, "images": drive["images"][:4]})
    moments = np.random.default_rng(seed).uniform(0.0, MAX_RUN_S, count)
    told = [kill(drive_file, folder, float(moment)) for moment in moments]
    lost = [one["lost_s"] for one in told if "lost_s" in one]
    return {
        "kills": count,
        "unreadable": sum("unreadable" in one for one in told),
        "lost_s": {"median": float(np.median(lost)), "largest": float(max(lost))} if lost else None,
        "each": told,
    }


def show(result: dict[str, Any], console: Console) -> None:
    """One row for each recording, then the kills."""
    table = Table(title=f"{result['seconds']:g} s at 80 ticks a second")
    for name in ("recorded", "call, median", "p99", "lateness, median", "p99", "largest", "processor", "MB/min"):
        table.add_column(name, justify="right")
    for name, told in result["recordings"].items():
        call = [f"{told['cost_us'][key]:.0f} us" if "cost_us" in told else "-" for key in ("median", "p99")]
        late = [f"{told['lateness_us'][key]:.0f} us" for key in ("median", "p99", "largest")]
        size = f"{told['mb_per_minute']:.1f}" if "mb_per_minute" in told else "-"
        table.add_row(name, *call, *late, f"{100 * told['cpu_share']:.1f} %", size)
    console.print(table)
    if result["kills"]:
        console.print({name: value for name, value in result["kills"].items() if name != "each"})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0, help="length of each recording")
    parser.add_argument("--kills", type=int, default=50, help="number of processes that are killed")
    parser.add_argument("--no-images", action="store_true", help="record no images; they need OpenGL")
    parser.add_argument("--seed", type=int, default=0, help="seed of the moments of the kills")
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--drive", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        with np.load(args.drive) as file:
            drive = dict(file)
        with Recorder(args.child, start_s=time.monotonic()) as recorder:
            pace(drive, recorder, tell=True)
        return
    prepare_folder(args.out.parent)
    drive = driven(args.seconds, not args.no_images)
    bare = {**drive, "images": drive["images"][:0]}
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        recordings = {name: cost(bare, place, name) for name in ("nothing", "ticks")}
        if not args.no_images:
            recordings["ticks and images"] = cost(drive, place, "images")
        killed = kills(drive, place, args.kills, args.seed) if args.kills else None
    result = {"seconds": args.seconds, "seed": args.seed, "host": host(), "recordings": recordings, "kills": killed}
    write_json(args.out, result)
    show(result, Console(width=140))


if __name__ == "__main__":
    main()
