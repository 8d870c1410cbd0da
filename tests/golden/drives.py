"""Drives whose every number is kept as a digest: what a change of the code must not change.

    python tests/golden/drives.py            # compare all drives, alone and in batches
    python tests/golden/drives.py --write    # keep what they do now

A digest holds where the arithmetic is the same: same MuJoCo, same last bits of NumPy's and C's functions.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import mujoco
import numpy as np

import tral_fsm

FILE = Path(__file__).with_name("drives.json")
DRIVEN_BY = {
    "straight": "wall",
    "doors": "doors",
    "corners": "corners",
    "loop": "loop",
    "lane_change": "lane_change",
    "obstacles": "obstacles",
    "gates": "gate_scurve",
    "crossing": "crossing",
    "office": "known_route",
}
"""The families that are kept, each with a machine beside `office`. A family that is added later need not be here."""
LEVELS = ("default", "hard")
SEEDS = (0, 1, 2)
TRUTH = (
    "success", "collision", "crash", "missed_gate", "progress", "gates_passed", "gates_total", "lateral_offset_m",
    "pose", "speed_mps", "time_s",
)  # fmt: skip
"""Entries of the environment's info that are digested."""


class Group(NamedTuple):
    """Drives that differ in their seeds alone."""

    scenario: str
    machine: str
    level: str
    camera: str = "projected"

    def name(self, seed: int) -> str:
        return f"{self.scenario} {self.machine} {self.level} {self.camera} {seed}"

    @property
    def options(self) -> dict[str, str]:
        return {"scenario": self.scenario, "randomization": self.level, "camera": self.camera}


GROUPS = [
    Group(scenario, machine, level)
    for level in LEVELS
    for scenario, made in DRIVEN_BY.items()
    for machine in (made, "office")
]
RAMP = [Group("gates", "gate", "default")]
RENDERED = Group("gates", "office", "hard", "rendered")


class Digest:
    """Sums over the ticks of one drive."""

    def __init__(self) -> None:
        self.ticks = 0
        self.sums = {name: hashlib.sha256() for name in ("observation", "action", "state", "wish", "truth", "reward")}

    def add(self, name: str, value: Any) -> None:
        data = value.encode() if isinstance(value, str) else np.asarray(value, np.float64).tobytes()
        self.sums[name].update(data)

    def record(self) -> dict[str, Any]:
        return {"ticks": self.ticks, **{name: digest.hexdigest()[:12] for name, digest in self.sums.items()}}


def alone(group: Group, seed: int) -> dict[str, Any]:
    """Digests of a drive of the single environment."""
    env = gym.make("tral_env:TralCorridor-v0", **group.options)
    policy = tral_fsm.load_policy(group.machine)
    observation, _ = env.reset(seed=seed)
    policy.reset()
    digest = Digest()
    ended = False
    while not ended:
        digest.add("observation", observation)
        action = policy.act(observation)
        digest.add("action", action)
        digest.add("state", policy.active_states[0])
        digest.add("wish", policy.wanted_clearance[0])
        observation, reward, terminated, truncated, info = env.step(action)
        digest.add("reward", reward)
        for name in TRUTH:
            digest.add("truth", info[name])
        digest.ticks += 1
        ended = terminated or truncated
    env.close()
    return digest.record()


def together(group: Group, seeds: tuple[int, ...] = SEEDS) -> list[dict[str, Any]]:
    """Digests of drives in a batch, of each row until it ends."""
    envs = gym.make_vec("tral_env:TralCorridor-v0", len(seeds), autoreset_mode="Disabled", **group.options)
    policy = tral_fsm.load_policy(group.machine)
    observation, _ = envs.reset(seed=list(seeds))
    policy.reset(len(seeds))
    digests = [Digest() for _ in seeds]
    running = np.ones(len(seeds), bool)
    while running.any():
        action = policy.act(observation)
        states, wishes = policy.active_states, policy.wanted_clearance
        before = observation
        observation, reward, terminated, truncated, info = envs.step(action)
        for row in np.flatnonzero(running):
            digest = digests[row]
            digest.add("observation", before[row])
            digest.add("action", action[row])
            digest.add("state", states[row])
            digest.add("wish", wishes[row])
            digest.add("reward", reward[row])
            for name in TRUTH:
                digest.add("truth", info[name][row])
            digest.ticks += 1
        running &= ~(terminated | truncated)
    envs.close()
    return [digest.record() for digest in digests]


def arithmetic() -> str:
    """Digest of what the last bits of numbers depend on here."""
    x = np.linspace(-7.0, 7.0, 1001)
    with np.errstate(invalid="ignore"):
        parts = [
            np.sin(x), np.cos(x), np.arctan2(x, x[::-1] + 0.3), np.exp(x), np.hypot(x, 1.3), np.sqrt(np.abs(x)),
            np.tan(x), np.log(np.abs(x) + 0.1), x[:9].reshape(3, 3) @ x[9:18].reshape(3, 3), np.cumsum(x),
            x[:25].reshape(5, 5).dot(x[25:50].reshape(5, 5)).dot(x[50:75].reshape(5, 5).T),
            np.linalg.inv(x[:9].reshape(3, 3) + np.eye(3)),
            np.array([f(v) for v in x.tolist() for f in (math.sin, math.tan, math.atan)]),
        ]  # fmt: skip
    digest = hashlib.sha256(mujoco.__version__.encode())
    for part in parts:
        digest.update(np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()[:12]


def load() -> dict[str, Any]:
    """What was kept."""
    kept: dict[str, Any] = json.loads(FILE.read_text())
    return kept


def _batch(group: Group) -> dict[str, Any]:
    return dict(zip([group.name(seed) for seed in SEEDS], together(group), strict=True))


def _single(group: Group) -> dict[str, Any]:
    seeds = (3,) if group.camera == "rendered" else SEEDS
    return {group.name(seed): alone(group, seed) for seed in seeds}


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--batches", action="store_true", help="batches alone: half of the time")
    args = parser.parse_args()
    kept = {} if args.write else load()["drives"]
    jobs = [(_batch, group) for group in [*GROUPS, *RAMP]]
    jobs += [(_single, RENDERED)]
    if not args.batches:
        jobs += [(_single, group) for group in [*GROUPS, *RAMP]]
    found: dict[str, Any] = {}
    wrong = 0
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        futures = [pool.submit(*job) for job in jobs]
        for (kind, _), future in zip(jobs, futures, strict=True):
            for name, record in future.result().items():
                expected = found.setdefault(name, record) if args.write else kept[name]
                if record != expected:
                    wrong += 1
                    parts = [part for part in record if record[part] != expected[part]]
                    print(f"{kind.__name__[1:]} {name}: {', '.join(parts)} differ ({record['ticks']} ticks)")
    if args.write:
        FILE.write_text(json.dumps({"arithmetic": arithmetic(), "drives": found}, indent=0, sort_keys=True) + "\n")
    print(f"{len(found) or len(kept)} drives, {wrong} differ")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
