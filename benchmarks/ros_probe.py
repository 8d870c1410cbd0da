"""What the benchmarks of the ROS nodes have in common: nodes in processes of their own, and one that hears them."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from tral_env.ros import topics
from tral_env.ros.car_node import PUBLISHED
from tral_env.ros.msg.sensor import AckermannDriveStamped
from tral_env.ros.msg.std import Bool, DiagnosticArray, Int64, Log
from tral_env.ros.node import WARN, Node
from tral_env.ros.qos import ANY_COMMAND, LOG, STATE
from tral_env.ros.times import nanoseconds

TRAL = (sys.executable, "-c", "from tral_fsm.cli import app; app()", "ros")
START_S = 120.0
"""Nodes have begun after this time, or they count as broken."""
_END_S = 10.0
HEARD = (topics.RESULT, topics.ARMED, topics.TRUTH, topics.APPLIED, *topics.RANGES.values(), topics.DETECTIONS)


class Probe:
    """A node that resets and arms the car, and hears what goes to and fro."""

    def __init__(self, heard: Sequence[str] = HEARD) -> None:
        self.node = node = Node("probe")
        self._arm, self._reset = node.publisher(topics.ARM, Bool, STATE), node.publisher(topics.RESET, Int64, STATE)
        self._heard = {topic: node.subscription(topic, *PUBLISHED[topic], wakes=True) for topic in heard}
        self._log = node.subscription("/rosout", Log, LOG)
        self._diagnostics = node.subscription(topics.DIAGNOSTICS, DiagnosticArray, STATE)
        self._commands = node.subscription(topics.THROTTLE_COMMAND, AckermannDriveStamped, ANY_COMMAND, wakes=True)
        self.armed, self.speed, self.why = False, 0.0, ""
        self.result: dict[str, Any] = {}
        self.figures: dict[str, dict[str, str]] = {}
        """What the nodes tell of themselves: name of the status -> its values."""
        self.fired_ns: dict[str, int] = {}
        self.ages_ms: list[float] = []
        self.counts: dict[str, int] = {}
        self.disarmed_s: float | None = None
        self.speeds: list[tuple[float, float]] = []
        """Time, s, and speed of the simulated car, m/s."""
        self.throttles: list[tuple[float, float]] = []
        """Time, s, and throttle as applied, as a speed, m/s."""

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
        for array in self._diagnostics.take():
            for status in array.status:
                self.figures[status.name] = {each.key: each.value for each in status.values}
        for _ in self._commands.take():
            self.counts["commands"] = self.counts.get("commands", 0) + 1
            now_ns = time.time_ns()
            self.ages_ms += [(now_ns - fired_ns) / 1e6 for fired_ns in self.fired_ns.values()]

    def hear_until(self, until_s: float) -> None:
        """Listen until a time of the monotonic clock, s."""
        while time.monotonic() < until_s:
            self.hear(0.02)

    def begin(self, seed: int | None = None) -> bool:
        """Put the car at the start of the course of a seed, if one is given, and arm it; whether it is armed."""
        until_s = time.monotonic() + START_S
        self.wait_for_nodes()
        if seed is not None:
            self._reset.publish(Int64(seed))
            self.hear_until(time.monotonic() + 0.2)
        self.result, self.ages_ms, self.counts, self.fired_ns, self.figures = {}, [], {}, {}, {}
        self.disarmed_s, self.speeds, self.throttles, self.why = None, [], [], ""
        self._arm.publish(Bool(True))
        while not self.armed and time.monotonic() < until_s:
            self.hear(0.05)
        return self.armed

    def wait_for_nodes(self) -> None:
        """Wait until the nodes `car` and `fsm` are there."""
        until_s = time.monotonic() + START_S
        while not (self._reset.listeners and self._commands.publishers) and time.monotonic() < until_s:
            self.hear(0.1)

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
            self.speeds.append((now_s, abs(self.speed)))
        elif topic == topics.APPLIED:
            self.throttles.append((now_s, message.drive.speed))
        elif topic in topics.RANGES.values():
            self.fired_ns[topic] = nanoseconds(message.header.stamp)


def start(command: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start a node, or all that a command line of `tral ros` names."""
    return subprocess.Popen([*TRAL, *command])


def end(process: subprocess.Popen[bytes]) -> None:
    """Wait for a process that was told to end; one that does not is killed."""
    try:
        process.wait(_END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@contextmanager
def processes(*commands: Sequence[str]) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Run nodes, each in a process of its own; the caller may put another process in the place of one."""
    started = [start(command) for command in commands]
    try:
        yield started
    finally:
        for process in started:
            process.send_signal(signal.SIGTERM)
        for process in started:
            end(process)
