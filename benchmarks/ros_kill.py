"""Nodes of ROS that die in the middle of a drive: how soon the car stands, and that only a new arming lets it go on.

On the simulated car the nodes are `car`, `camera` and `fsm`. On the twin they are those of a real car, `--backend car`
with a car file, and its actuator's process is killed too: the twin lives on, and what leaves its board is read every
two milliseconds. The policy is `office` on one long straight. After each fault the node is started again, nobody arms
for some seconds, then a message does.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from car_faults import LENGTH_M, SWITCH_S, Looks, pid_of, times
from deploy_twin import car_file
from ros_probe import START_S, Probe, processes, start

from tral_env.calibration.camera_info import write_camera_info
from tral_env.config import CameraConfig
from tral_env.ros import topics
from tral_env.twin.settings import TwinSettings
from tral_env.twin.twin import Twin

SEED = 1000
NODES = ("car", "camera", "fsm")
WORKERS = {"worker": "tral-worker", "keeper": "tral-keeper"}
"""Killed on the twin beside the nodes: the processes of its actuator."""
FAULTS = ("camera-frozen", "camera-gone")
"""What the camera of the twin may do, as its faults are named."""
DRIVING_S, LOOK_S = 5.0, 5.0
"""So long the car drives before a node is killed, and is looked at after it, s."""
UNARMED_S = 3.0
"""So long a node that was started again is not armed, s."""
AGAIN_S = 20.0
"""After it was armed again, the car moves within this time, or it does not, s."""
MOVES_MPS, STANDS_MPS = 0.2, 0.02
NEUTRAL_US = 1530.0
"""Of the calibration `tt01`."""


def kills(known: Sequence[tuple[str, str]]) -> Iterator[dict[str, Any]]:
    """End everything in turn that is not known yet."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        course = {"name": "kill", "segments": [{"length": LENGTH_M}]}
        (folder / "course.json").write_text(json.dumps(course))
        for victim in NODES:
            if ("simulation", victim) not in known:
                yield told("simulation", victim, in_simulation(victim, folder))
        if victims := [each for each in (*NODES, *WORKERS, *FAULTS) if ("twin", each) not in known]:
            yield from on_twin(victims, folder)


def told(car: str, victim: str, found: dict[str, Any]) -> dict[str, Any]:
    """A result with its circumstances."""
    return {"car": car, "killed": victim, **found, "nice": os.nice(0), "load": os.getloadavg()[0]}


def in_simulation(victim: str, folder: Path) -> dict[str, Any]:
    """Kill a node of the simulated car."""
    nodes = {
        "car": ["car", "--scenario", "straight", "--course", str(folder / "course.json"), "--camera", "rendered",
                "--randomization", "none", "--seed", str(SEED)],
        "camera": ["camera"],
        "fsm": ["fsm", "--policy", "office"],
    }  # fmt: skip
    with processes(*nodes.values()) as started:
        probe = Probe()
        begin(probe, lambda: probe.speed)
        speed, killed_s = probe.speed, kill(started[NODES.index(victim)])
        probe.hear_until(killed_s + LOOK_S)
        after = [(when_s, mps) for when_s, mps in probe.speeds if when_s > killed_s]
        throttles = [(when_s, mps) for when_s, mps in probe.throttles if when_s > killed_s]
        found: dict[str, Any] = {
            "speed_mps": speed,
            "why": probe.why,
            "disarmed_ms": since(killed_s, probe.disarmed_s),
            "neutral_ms": since(killed_s, begins(throttles, 0.0)),
            "stands_ms": since(killed_s, begins(after, STANDS_MPS)),
            "last_message_ms": since(killed_s, max((when_s for when_s, _ in probe.speeds), default=None)),
        }
        started[NODES.index(victim)] = start(nodes[victim])
        found |= again(probe, lambda: abs(probe.speed))
        probe.node.close()
    return found


def on_twin(victims: Sequence[str], folder: Path) -> Iterator[dict[str, Any]]:
    """Kill what drives the twin as it drives a real car."""
    sys.setswitchinterval(SWITCH_S)
    settings = TwinSettings(
        name="ros-kill", scenario="straight", course=str(folder / "course.json"), randomization="none", bus=None,
        serial=False, camera=True, folder=str(folder / "twin"), seed=SEED,
    )  # fmt: skip
    write_camera_info(folder / "lens.yaml", CameraConfig())
    with Twin(settings) as twin:
        (folder / "car.toml").write_text(car_file(twin.status(), "pca9685"))
        for victim in victims:
            yield told("twin", victim, of_twin(victim, twin, folder))


def of_twin(victim: str, twin: Twin, folder: Path) -> dict[str, Any]:
    """Kill one of them."""
    car = ["--backend", "car", "--config", str(folder / "car.toml")]
    source = str(twin.status()["camera"])  # as a stream its images come with the time of their exposure
    nodes = {"car": ["car", *car], "camera": ["camera", *car, "--source", source], "fsm": ["fsm", "--policy", "office"]}
    twin.reset(SEED)
    with processes(*nodes.values()) as started:
        probe = Probe((topics.ARMED,))
        looks = Looks(twin)

        def speed() -> float:
            return looks.rows[-1][2] if looks.rows else 0.0

        try:
            begin(probe, speed)
            killed_s = end_something(victim, twin, started)
            probe.hear_until(killed_s + LOOK_S)
            rows = list(looks.rows)
            found: dict[str, Any] = times(rows, killed_s, NEUTRAL_US)
            stood_s = begins([(when_s, mps) for when_s, _, mps in rows if when_s > killed_s], STANDS_MPS)
            found |= {
                "why": probe.why,
                "disarmed_ms": since(killed_s, probe.disarmed_s),
                "stands_ms": since(killed_s, stood_s),
            }
            if victim in FAULTS:
                twin.faults.end(victim)
            elif victim in NODES:
                started[NODES.index(victim)] = start(nodes[victim])
            found |= again(probe, speed)
        finally:
            looks.close()
            probe.node.close()
    return found


def end_something(victim: str, twin: Twin, started: list[subprocess.Popen[bytes]]) -> float:
    """Kill a node or a process of the actuator, or let the camera fail; the time, s."""
    if victim in FAULTS:
        killed_s = time.monotonic()
        twin.faults.begin(victim)
        return killed_s
    if victim in NODES:
        return kill(started[NODES.index(victim)])
    pid, killed_s = pid_of(WORKERS[victim], started[0].pid), time.monotonic()
    os.kill(pid, signal.SIGKILL)
    return killed_s


def kill(process: subprocess.Popen[bytes]) -> float:
    """End a process without a word; the time, s."""
    killed_s = time.monotonic()
    process.kill()
    process.wait()
    return killed_s


def begin(probe: Probe, speed: Any) -> None:
    """Arm the car, and let it drive for some time.

    Raises:
        RuntimeError: it does not drive.
    """
    until_s = time.monotonic() + START_S
    while speed() < MOVES_MPS:
        if time.monotonic() > until_s:
            raise RuntimeError(f"the car does not drive: {probe.why}")
        if not probe.armed:
            probe.begin()
        probe.hear(0.02)
    probe.hear_until(time.monotonic() + DRIVING_S)
    probe.disarmed_s = None


def again(probe: Probe, speed: Any) -> dict[str, Any]:
    """Nobody arms for some time, then somebody does: how fast the car was before, and how long it takes to move, s."""
    probe.hear_until(time.monotonic() + UNARMED_S)
    probe.wait_for_nodes()
    fastest_mps, until_s, was_armed = 0.0, time.monotonic() + UNARMED_S, probe.armed
    while time.monotonic() < until_s:
        probe.hear(0.01)
        fastest_mps, was_armed = max(fastest_mps, speed()), was_armed or probe.armed
    begun_s = time.monotonic()
    probe.begin()
    until_s = begun_s + START_S + AGAIN_S
    while speed() < MOVES_MPS and time.monotonic() < until_s:
        probe.hear(0.01)
        if not probe.armed and time.monotonic() - begun_s > AGAIN_S:
            break
    moves_s = time.monotonic() - begun_s if speed() >= MOVES_MPS else None
    return {
        "armed_before_it_was_armed": was_armed,
        "fastest_before_mps": fastest_mps,
        "moves_after_arming_s": moves_s,
        "why_then": probe.why if moves_s is None else "",
    }


def begins(rows: Sequence[tuple[float, float]], limit: float) -> float | None:
    """Time from which on the value stays within a limit; None: it does not."""
    last = max((k for k, (_, value) in enumerate(rows) if value > limit), default=-1)
    return rows[last + 1][0] if last + 1 < len(rows) else None


def since(begun_s: float, when_s: float | None) -> float | None:
    """Time from then on, ms."""
    return None if when_s is None else (when_s - begun_s) * 1e3
