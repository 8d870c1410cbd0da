"""A machine drives the twin in real time, and the simulated car on the same courses: success beside success.

    python benchmarks/twin.py --out runs/twin.json

Each course is driven by `TralCar-v0` with its actuator process against the twin's I2C bus and hall pin, then by
`TralCorridor-v0` with the same course and car, once as drawn and once with sonars that fire together, as those of the
twin do. One drive takes as long as the drive. Progress is written as it comes.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from tral_env.hardware.calibration_file import load_calibration
from tral_env.hardware.sensors import SensorGroup
from tral_env.hardware.sonar import SonarArray
from tral_env.twin.hall import TwinHall
from tral_env.twin.running import TwinProcess
from tral_env.twin.settings import TwinSettings
from tral_fsm import load_policy
from tral_fsm.evaluation.files import prepare_folder
from tral_fsm.evaluation.host import host

PAIRS = (("wall", "straight"), ("corners", "corners"))
_PATIENCE_S = 5.0
"""Ticks go on for so long after the twin's drive has ended, at most."""


def _open_car(status: dict[str, Any]) -> gym.Env[Any, Any]:
    """The car's own environment at a twin, with a calibration that knows the clock of the twin's board."""
    calibration = load_calibration("tt01").model_copy(
        update={"oscillator_hz": float(status["oscillator_hz"]), "clock_measured": True}
    )
    return gym.make(
        "tral_env:TralCar-v0",
        calibration=calibration,
        output="pca9685",
        sensors=SensorGroup(SonarArray(bus=status["i2c"]), TwinHall(Path(status["hall"]))),
        bus=status["i2c"],
        max_duration_s=status["truth"]["time_limit_s"] + _PATIENCE_S,
    )


def drive_twin(twin: TwinProcess, machine: str, seed: int) -> dict[str, Any]:
    """One drive on the twin."""
    twin.reset(seed)  # its status tells the time limit
    car = _open_car(twin.status())
    policy = load_policy(machine)
    policy.reset()
    took_s, outcome, ended, ticks = [], None, False, 0
    try:
        observation, _ = car.reset()
        twin.reset(seed)  # arming took a second of the drive's time
        begun = time.monotonic()
        while not ended and outcome is None:
            before = time.monotonic()
            observation, _, _, ended, info = car.step(policy.act(observation))
            took_s.append(time.monotonic() - before)
            ticks = info["tick"]
            if ticks % 20 == 0:
                outcome = twin.outcome()
        late_ticks = info["late_ticks"]
    except OSError as error:
        outcome, late_ticks = {"ended": f"the car stopped: {error}"[:300]}, -1
    finally:
        car.close()
    return {
        **(outcome or {"ended": "time is up"}),
        "ticks": ticks,
        "late_ticks": late_ticks,
        "step_p50_ms": float(np.median(took_s)) * 1e3,
        "step_p99_ms": float(np.quantile(took_s, 0.99)) * 1e3,
        "step_max_ms": max(took_s) * 1e3,
        "rate_hz": ticks / (time.monotonic() - begun),
        "twin": twin.status()["lateness"],
    }


def drive_plain(machine: str, settings: TwinSettings, seed: int, car: dict[str, float]) -> dict[str, Any]:
    """One drive of the simulated car, with some parameters given."""
    env = gym.make("tral_env:TralCorridor-v0", scenario=settings.scenario, randomization=settings.randomization)
    policy = load_policy(machine)
    policy.reset()
    observation, _ = env.reset(seed=seed, options={"car": car} if car else None)
    ended = False
    while not ended:
        observation, _, terminated, truncated, info = env.step(policy.act(observation))
        ended = terminated or truncated
    env.close()
    return {"success": bool(info["success"]), "progress": float(info["progress"]), "time_s": float(info["time_s"])}


def main() -> None:
    """Drive all pairs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--courses", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--bus", type=int, default=None, help="number of the twin's bus; none: no link in /dev")
    parser.add_argument("--pairs", default=",".join(f"{machine}:{scenario}" for machine, scenario in PAIRS))
    parser.add_argument("--randomization", default="default")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    prepare_folder(given.out.parent)
    drives: list[dict[str, Any]] = []
    for pair in given.pairs.split(","):
        machine, scenario = pair.split(":")
        settings = TwinSettings(
            name=f"bench-{scenario}",
            scenario=scenario,
            randomization=given.randomization,
            bus=given.bus,
            serial=False,
        )
        with TwinProcess(settings) as twin:
            for seed in range(given.seed, given.seed + given.courses):
                drive = {"machine": machine, "scenario": scenario, "seed": seed}
                drive["twin"] = drive_twin(twin, machine, seed)
                drive["plain"] = drive_plain(machine, settings, seed, {})
                drive["plain_together"] = drive_plain(machine, settings, seed, {"sonar_together": 1.0})
                drives.append(drive)
                report = {"host": host(), "randomization": given.randomization, "drives": drives}
                given.out.write_text(json.dumps(report, indent=1))
                print(json.dumps(drive), flush=True)


if __name__ == "__main__":
    main()
