"""A policy drives the simulated car through three processes of ROS 2 over loopback, and in the plain env beside it.

    python benchmarks/ros.py --families straight,gates --courses 10 --seed 1000 --out runs/ros.json

The processes are `tral ros car`, `tral ros fsm` and, with `--camera rendered`, `tral ros camera`. This program resets
and arms the car by messages, and hears what it tells. The age of a range at the policy is the time from its stamp until
a command is here. With `--lock-step` each tick waits for its answer, so that a busy computer changes nothing, and no
ages are measured. `--kill` ends each node in turn in the middle of a drive instead.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from tral_env.ros import topics
from tral_env.ros.car_node import PUBLISHED
from tral_env.ros.msg.sensor import AckermannDriveStamped
from tral_env.ros.msg.std import Bool, Int64, Log
from tral_env.ros.node import WARN, Node
from tral_env.ros.qos import ANY_COMMAND, LOG, STATE
from tral_env.ros.times import nanoseconds
from tral_fsm import load_policy
from tral_fsm.evaluation.files import prepare_folder
from tral_fsm.evaluation.host import host

_TRAL = [sys.executable, "-c", "from tral_fsm.cli import app; app()", "ros"]
_START_S, _DRIVE_S = 90.0, 400.0
_STANDING_MPS = 0.05


class Probe:
    """A node that resets and arms the car, and hears what goes to and fro."""

    def __init__(self) -> None:
        self.node = node = Node("probe")
        self._arm, self._reset = node.publisher(topics.ARM, Bool, STATE), node.publisher(topics.RESET, Int64, STATE)
        self._heard = {
            topic: node.subscription(topic, *PUBLISHED[topic], wakes=True)
            for topic in (topics.RESULT, topics.ARMED, topics.TRUTH, *topics.RANGES.values(), topics.DETECTIONS)
        }
        self._log = node.subscription("/rosout", Log, LOG)
        self.why = ""
        self._commands = node.subscription(topics.THROTTLE_COMMAND, AckermannDriveStamped, ANY_COMMAND, wakes=True)
        self.armed, self.result, self.speed = False, {}, 0.0
        self.fired_ns: dict[str, int] = {}
        self.ages_ms: list[float] = []
        self.counts: dict[str, int] = {}
        self.last_command_s = 0.0
        self.disarmed_s: float | None = None
        self.stood_s: float | None = None

    def hear(self, seconds: float) -> None:
        """Listen for some time at most."""
        self.node.wait(seconds)
        for topic, subscription in self._heard.items():
            for message in subscription.take():
                self.counts[topic] = self.counts.get(topic, 0) + 1
                self._note(topic, message)
        for line in self._log.take():
            if line.level >= WARN:
                self.why = f"{line.name}: {line.msg}"
        for _ in self._commands.take():
            self.counts["commands"] = self.counts.get("commands", 0) + 1
            self.last_command_s = time.monotonic()
            now_ns = time.time_ns()
            self.ages_ms += [(now_ns - fired_ns) / 1e6 for fired_ns in self.fired_ns.values()]

    def begin(self, seed: int) -> None:
        """Put the car at the start of a course, and arm it."""
        while not (self._arm.listeners and self._commands.publishers):
            self.hear(0.1)
        self._reset.publish(Int64(seed))
        self.hear(0.2)
        self.result, self.ages_ms, self.counts, self.fired_ns = {}, [], {}, {}
        self.disarmed_s = self.stood_s = None
        until_s = time.monotonic() + _START_S
        self._arm.publish(Bool(True))
        while not self.armed and time.monotonic() < until_s:
            self.hear(0.05)

    def lost(self) -> dict[str, int]:
        """Messages that were sent and never came here."""
        return {topic: subscription.lost for topic, subscription in self._heard.items()}

    def _note(self, topic: str, message: Any) -> None:
        now_s = time.monotonic()
        if topic == topics.RESULT:
            self.result = json.loads(message.data)
        elif topic == topics.ARMED:
            if self.armed and not message.data:
                self.disarmed_s = now_s
            self.armed = message.data
        elif topic == topics.TRUTH:
            self.speed = message.twist.twist.linear.x
            if self.stood_s is None and abs(self.speed) < _STANDING_MPS:
                self.stood_s = now_s
        elif topic in topics.RANGES.values():
            self.fired_ns[topic] = nanoseconds(message.header.stamp)


@contextmanager
def processes(*commands: list[str]) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Run nodes, each in a process of its own."""
    started = [subprocess.Popen([*_TRAL, *command]) for command in commands]
    try:
        yield started
    finally:
        for process in started:
            process.send_signal(signal.SIGTERM)
        for process in started:
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()


def commands_of(given: argparse.Namespace, family: str) -> list[list[str]]:
    """Command lines of the nodes."""
    found = [
        ["car", "--backend", given.backend, "--scenario", family, "--camera", given.camera, "--seed", str(given.seed)],
        ["fsm", "--policy", given.policy],
    ]
    found[0] += ["--command-timeout", str(given.command_timeout)]
    if given.lock_step:
        found[0], found[1] = [*found[0], "--lock-step"], [*found[1], "--use-sim-time"]
    return found + ([["camera"]] if given.camera == "rendered" else [])


def drive(probe: Probe, seed: int) -> dict[str, Any]:
    """One drive through ROS."""
    probe.begin(seed)
    until_s = time.monotonic() + _DRIVE_S
    while probe.armed and time.monotonic() < until_s:
        probe.hear(0.05)
    until_s = time.monotonic() + 5.0
    while not probe.result and time.monotonic() < until_s:
        probe.hear(0.05)
    ages = np.percentile(probe.ages_ms or [np.nan], [50, 99]).tolist()
    ended = probe.result or {"success": False, "ended": probe.why}
    return {**ended, "age_ms": dict(zip(("p50", "p99"), ages, strict=True)), "messages": dict(probe.counts)}


def drive_plain(policy_name: str, family: str, seed: int, camera: str) -> dict[str, Any]:
    """The same course and car in the plain environment."""
    env = gym.make("tral_env:TralCorridor-v0", scenario=family, camera=camera, groups=("imu", "battery"))
    policy = load_policy(policy_name)
    policy.reset()
    observation, _ = env.reset(seed=seed)
    ended = False
    while not ended:
        observation, _, terminated, truncated, info = env.step(policy.act(observation))
        ended = terminated or truncated
    env.close()
    return {"success": bool(info["success"]), "progress": float(info["progress"]), "time_s": float(info["time_s"])}


def kill_each(given: argparse.Namespace, family: str) -> list[dict[str, Any]]:
    """End each node in turn by SIGKILL, after some seconds of a drive."""
    found = []
    for number, command in enumerate(commands_of(given, family)):
        if command[0] not in given.nodes.split(","):
            continue
        with processes(*commands_of(given, family)) as started:
            probe = Probe()
            probe.begin(given.seed + number)
            until_s = time.monotonic() + given.after
            while time.monotonic() < until_s:
                probe.hear(0.02)
            speed = probe.speed
            probe.stood_s = None
            killed_s = time.monotonic()
            os.kill(started[number].pid, signal.SIGKILL)
            while time.monotonic() < killed_s + 4.0:
                probe.hear(0.005)
            report = {"killed": command[0], "speed_mps": speed, "why": probe.why}
            for name, when_s in (("disarmed_s", probe.disarmed_s), ("stood_s", probe.stood_s)):
                report[name] = None if when_s is None else when_s - killed_s
            report["last_command_s"] = probe.last_command_s - killed_s
            probe.node.close()
            found.append(report)
            print(json.dumps(report), flush=True)
    return found


def main() -> None:
    """Drive all courses."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--families", default="straight,gates")
    parser.add_argument("--policy", default="office")
    parser.add_argument("--backend", default="simulation")
    parser.add_argument("--camera", default="projected")
    parser.add_argument("--courses", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--command-timeout", type=float, default=0.15)
    parser.add_argument("--lock-step", action="store_true")
    parser.add_argument("--kill", action="store_true")
    parser.add_argument("--nodes", default="car,fsm,camera", help="which of them --kill ends")
    parser.add_argument("--after", type=float, default=6.0, help="s of a drive before a node is ended")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    prepare_folder(given.out.parent)
    report: dict[str, Any] = {"host": host(), "load": os.getloadavg(), "drives": []}
    report["arguments"] = {name: str(value) for name, value in vars(given).items()}
    for family in given.families.split(","):
        if given.kill:
            report["drives"] += kill_each(given, family)
            given.out.write_text(json.dumps(report, indent=1))
            continue
        with processes(*commands_of(given, family)):
            probe = Probe()
            for seed in range(given.seed, given.seed + given.courses):
                one = {"family": family, "seed": seed, "ros": drive(probe, seed), "lost": probe.lost()}
                one["plain"] = drive_plain(given.policy, family, seed, given.camera)
                report["drives"].append(one)
                given.out.write_text(json.dumps(report, indent=1))
                print(json.dumps(one), flush=True)
            probe.node.close()


if __name__ == "__main__":
    main()
