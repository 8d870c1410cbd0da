"""`tral deploy` drives the twin over a bus or a serial port, with the twin's camera; beside it the simulated car.

    nice -n -10 python benchmarks/deploy_twin.py --board pca9685 --out runs/deploy_pca9685.json
    python benchmarks/deploy_twin.py --board simulation --out runs/deploy_simulation.json
    python benchmarks/deploy_twin.py --board together --out runs/deploy_together.json

Each course is driven by the command itself, `tral deploy --policy office --config car.toml`: pre-flight, arming,
recording. Its camera is the twin's MJPEG stream, over OpenCV and the detector. Beside it stands `TralCorridor-v0` with
the rendered camera, the same courses and cars: "simulation" as they are drawn, "together" with sonars that fire
together, as those of the twin do. One drive takes as long as the drive. Each result is written as it comes; the script
begins where its file ends.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from tral_env.calibration.camera_info import write_camera_info
from tral_env.config import CameraConfig
from tral_env.interface import CORE_LAYOUT, NOTHING_SEEN_ID, Layout
from tral_env.recording.read import read
from tral_env.twin.camera import IMAGE_RATE_HZ
from tral_env.twin.running import TwinProcess
from tral_env.twin.settings import TwinSettings
from tral_fsm import load_policy
from tral_fsm.evaluation.files import prepare_folder
from tral_fsm.evaluation.host import host

FAMILIES = "gates:8,corners:6,office:6"
FIRST_SEED = 1000
LATENCY_S = 0.035
"""`latency_s` of the car file's camera: an image of the twin comes 15 to 55 ms after its exposure, by the car."""
START_S = 60.0
"""The command has begun to drive after this time, or it counts as broken."""
MORE_S = 5.0
"""The command may drive so much longer than the course allows."""
POLL_S = 0.2
SIMULATED: Mapping[str, dict[str, float]] = {"simulation": {}, "together": {"sonar_together": 1.0}}
"""What is given to a simulated car beside what its seed draws."""
DAY = "2026-01-01"


def car_file(status: dict[str, Any], board: str) -> str:
    """The file of the car that the twin is; its clock was measured, and each step of the calibration was done."""
    sensors: tuple[dict[str, str], ...]
    if board == "pca9685":
        table = f'bus = "{status["i2c"]}"\noscillator_hz = {status["oscillator_hz"]:.0f}\nclock_measured = true\n'
        sensors = {"driver": "srf08", "bus": status["i2c"]}, {"driver": "twin-hall", "path": status["hall"]}
    else:
        table = f'port = "{status["serial"][board]}"\n'
        sensors = ({"driver": board, "port": status["serial"][board]},)
    camera = f'device = "{status["camera"]}"\nlens = "lens.yaml"\n'
    camera += f"rate_hz = {IMAGE_RATE_HZ:g}\nlatency_s = {LATENCY_S:g}\n"
    parts = ['version = 1\nname = "twin"\n', f'[board]\ndriver = "{board}"\n{table}', '[pulses]\nfile = "tt01"\n']
    parts += ["[[sensors]]\n" + "".join(f'{name} = "{value}"\n' for name, value in each.items()) for each in sensors]
    steps = ("clock", "neutral", "ends", "direction", "dead_zone", "arming", "hall", "sonars", "camera")
    days = "".join(f"{step} = {DAY}\n" for step in steps)
    return "\n".join([*parts, f"[camera]\n{camera}", f"[calibrated]\n{days}"])


def deploy(twin: TwinProcess, seed: int, board: str, folder: Path) -> dict[str, Any]:
    """One drive of `tral deploy` on the twin."""
    twin.reset(seed)
    status = twin.status()
    (folder / "car.toml").write_text(car_file(status, board))
    write_camera_info(folder / "lens.yaml", CameraConfig())
    out, log = folder / "out", folder / "log.txt"
    shutil.rmtree(out, ignore_errors=True)
    command = [
        sys.executable, "-c", "from tral_fsm.cli import app; app()", "deploy", "--policy", "office", "--arm",
        "--config", str(folder / "car.toml"), "--out", str(out),
        "--seconds", f"{status['truth']['time_limit_s'] + MORE_S:g}",
    ]  # fmt: skip
    skipped_s = status["lateness"]["lost_s"]
    with log.open("w") as stream:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=stream, stderr=stream,
            env=os.environ | {"PYTHONUNBUFFERED": "1"}, start_new_session=True,
        )  # fmt: skip
        try:
            await_preflight(process, log)
            twin.reset(seed)  # the pre-flight took some of the course's time
            while process.poll() is None and twin.outcome() is None:
                time.sleep(POLL_S)
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            process.wait(30.0)
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
    told, status = of_recording(out), twin.status()
    stopped = {"ended": f"the car stopped: {told['ended_by']}", "progress": status["truth"].get("progress", math.nan)}
    return {
        **(status["outcome"] or stopped),
        "gates_passed": status["truth"].get("gates_passed"),
        "twin_late": status["lateness"],
        "twin_skipped_s": status["lateness"]["lost_s"] - skipped_s,
        **told,
    }


def await_preflight(process: subprocess.Popen[bytes], log: Path) -> None:
    """Wait until the pre-flight is over.

    Raises:
        RuntimeError: it refused the car, or never came.
    """
    until_s = time.monotonic() + START_S
    while "pre-flight, camera" not in log.read_text():
        if process.poll() is not None or time.monotonic() > until_s:
            raise RuntimeError(f"tral deploy did not begin: {log.read_text()[-2000:]}")
        time.sleep(0.02)


def of_recording(out: Path) -> dict[str, Any]:
    """What the summary and the recording of a drive tell."""
    summary = json.loads((out / "summary.json").read_text())
    recording = read(out / "drive.mcap")
    clock_s = recording.clock_s
    rate_hz = (len(clock_s) - 1) / (clock_s[-1] - clock_s[0]) if len(clock_s) > 1 else 0.0
    figures = summary["figures"]
    return {
        "ended_by": summary["ended_by"],
        "warnings": summary["warnings"],
        "ticks": figures["ticks"],
        "drive_s": float(clock_s[-1] - clock_s[0]),
        "rate_hz": float(rate_hz),
        "late_ticks": figures["late_ticks"],
        "lateness_ms": figures["lateness_ms"],
        "retries": figures["retries"],
        "images": sum(1 for _ in recording.pictures()),
        "damage": recording.damage,
        **sightings(recording.observation, recording.layout),
    }


def sightings(observations: NDArray[np.float32], layout: Layout) -> dict[str, int]:
    """How often a gate and a sign were seen anew: their age fell, and they have an id."""
    columns = layout.unpack(observations)
    found = {}
    for subject in ("gate", "marker"):
        age, number = columns[f"{subject}_age"], columns[f"{subject}_id"]
        fresh = (np.diff(age) < 0.0) & (number[1:] != NOTHING_SEEN_ID)
        found[f"{subject}s_seen"] = int(np.sum(fresh))
    return found


def drive_simulation(settings: TwinSettings, seed: int, car: dict[str, float]) -> dict[str, Any]:
    """The same course and car in simulation, with the rendered camera."""
    env = gym.make(
        "tral_env:TralCorridor-v0",
        scenario=settings.scenario,
        randomization=settings.randomization,
        camera="rendered",
    )
    policy = load_policy("office")
    policy.reset()
    observation, _ = env.reset(seed=seed, options={"car": car} if car else None)
    seen, ended = [observation], False
    while not ended:
        observation, _, terminated, truncated, info = env.step(policy.act(observation))
        seen.append(observation)
        ended = terminated or truncated
    env.close()
    told = {name: info[name] for name in ("success", "progress", "time_s", "gates_passed", "gates_total")}
    return {name: np.asarray(value).item() for name, value in told.items()} | sightings(np.array(seen), CORE_LAYOUT)


def settings_of(board: str, scenario: str) -> TwinSettings:
    """The twin of a board."""
    return TwinSettings(
        name=f"deploy-{board}", scenario=scenario, bus=None, board=board, serial=board != "pca9685", camera=True
    )


def main() -> None:
    """Drive all courses that have no result yet."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--board", choices=("pca9685", "board2016", "ucboard", *SIMULATED), default="pca9685")
    parser.add_argument("--families", default=FAMILIES, help="family:number of courses, ...")
    parser.add_argument("--seed", type=int, default=FIRST_SEED)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    prepare_folder(given.out.parent)
    report = json.loads(given.out.read_text()) if given.out.exists() else {"board": given.board, "drives": []}
    done = {(drive["scenario"], drive["seed"]) for drive in report["drives"]}
    seed = given.seed
    for each in given.families.split(","):
        scenario, number = each.split(":")
        seeds = [one for one in range(seed, seed + int(number)) if (scenario, one) not in done]
        seed += int(number)
        for drive in drives(given.board, scenario, seeds, given.out.with_suffix("")):
            report["drives"].append(drive)
            report["host"] = host()
            given.out.write_text(json.dumps(report, indent=1))
            print(json.dumps(drive), flush=True)


def drives(board: str, scenario: str, seeds: list[int], folder: Path) -> Iterator[dict[str, Any]]:
    """Drives of one family; the files of each drive on the twin stay in a folder of its own."""
    if board in SIMULATED:
        settings = settings_of("pca9685", scenario)
        for seed in seeds:
            yield {"scenario": scenario, "seed": seed} | drive_simulation(settings, seed, SIMULATED[board])
    elif seeds:
        with TwinProcess(replace(settings_of(board, scenario), seed=seeds[0])) as twin:
            for seed in seeds:
                (own := folder / f"{scenario}_{seed}").mkdir(parents=True, exist_ok=True)
                yield {"scenario": scenario, "seed": seed, "nice": os.nice(0)} | deploy(twin, seed, board, own)


if __name__ == "__main__":
    main()
