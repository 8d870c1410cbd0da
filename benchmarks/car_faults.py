"""Faults of a drive on the twin, and the times until neutral, until no pulses, and the way that the car still rolls.

    python benchmarks/car_faults.py --out runs/car_faults.json

Each drive is that of `tral deploy` in a process of its own, with its actuator process, on the I2C bus and the hall pin
of a twin. After some seconds at 0.5 m/s one fault begins. What leaves the board is read every two milliseconds. The
table is that of docs/safety.md. A run that was broken off goes on where its file ends. "clock set back" needs the C
compiler `cc`.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

from car_faults_drive import BOARDS, END_S, HANDS, POLICY
from clock_set_back import CLOCK, library

DRIVE = Path(__file__).with_name("car_faults_drive.py")
LOOK_S = 0.002
SWITCH_S = 0.0005
"""Threads of the twin give way to each other after this time, as in a process of its own."""
TRIES = 3
STAYS_MS = END_S * 1e3 - 500.0
"""A throttle that stands for longer stays until the fault is taken away."""
LENGTH_M = 40.0
SIGNALS = {
    "SIGTERM": ("policy", signal.SIGTERM),
    "SIGINT": ("policy", signal.SIGINT),
    "SIGHUP": ("policy", signal.SIGHUP),
    "SIGKILL": ("policy", signal.SIGKILL),
    "SIGSTOP": ("policy", signal.SIGSTOP),
    "SIGKILL of the worker": ("tral-worker", signal.SIGKILL),
    "SIGSTOP of the worker": ("tral-worker", signal.SIGSTOP),
    "SIGKILL of the keeper": ("tral-keeper", signal.SIGKILL),
    "SIGSTOP of the keeper": ("tral-keeper", signal.SIGSTOP),
}
"""Faults that come from outside: who gets which signal."""
TWIN = {
    "sonars silent": ("sonar-silent", 1.0),
    "sonars frozen": ("sonar-frozen", 1.0),
    "hall off": ("hall-off", 1.0),
    "hall bouncing": ("hall-bouncing", 1.0),
    "I2C errors, 1 in 10": ("i2c-errors", 0.1),
    "I2C errors, all": ("i2c-errors", 1.0),
    "bus blocks for 1 s": ("i2c-timeout", 1.0),
    "bus held low": ("bus-stuck", 1.0),
    "brown-out of the board": ("brown-out", 1.0),
    "disk full while recording": ("disk-full", 1.0),
}
"""What happens to the car: a fault of the twin, and its rate."""
COMPUTER = ("clock set back",)
"""What happens to the computer: its calendar clock goes an hour back."""
CAMERA = {"camera gone": ("camera-gone", 1.0), "camera frozen": ("camera-frozen", 1.0)}
"""The same, for a car with a camera."""
SERIAL = {"serial unplugged": ("serial-unplugged", 1.0), "serial garbage": ("serial-garbage", 1.0)}
"""The same, for a car with a serial board."""
BLOCKED_S = 1.0
"""A bus that blocks does so for so long, s."""
GOES_ON = ("hall bouncing", "I2C errors, 1 in 10", "disk full while recording", "clock set back")
"""These end no drive."""
GOES_ON_S = 4.0
"""Such a drive is looked at for so long after its fault began, s; then the benchmark ends it."""
CAR = {**TWIN, **CAMERA, **{f"{name}, {board}": fault for board in BOARDS for name, fault in SERIAL.items()}}
"""All that happens to the car."""
ALL = (*POLICY, *SIGNALS, *HANDS, *COMPUTER, *CAR)


def kind_of(fault: str) -> str:
    """Which car the fault needs: "pca9685", "camera", or the name of a serial board."""
    return "camera" if fault in CAMERA else next((board for board in BOARDS if fault.endswith(board)), "pca9685")


class Looks:
    """Looks at what leaves the board, and at the car, until it is told to end."""

    def __init__(self, twin: Any) -> None:
        self._twin, self._ends = twin, threading.Event()
        self.rows: list[tuple[float, float, float]] = []
        """Time, s; pulse of the throttle, us; speed, m/s."""
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End."""
        self._ends.set()
        self._thread.join()

    def _look(self) -> None:
        while not self._ends.wait(LOOK_S):
            throttle_us = self._twin.pulses.now_us[1]
            self.rows.append((time.monotonic(), throttle_us, abs(float(self._twin.car.info.get("speed_mps", 0.0)))))


def pid_of(name: str, policy: int) -> int:
    """Process id of the policy, or of a process of this name below it."""
    if name == "policy":
        return policy
    parents = {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            text = (entry / "stat").read_text()
        except OSError:
            continue
        own = text[text.index("(") + 1 : text.rindex(")")]
        parents[int(entry.name)] = (own, int(text.rsplit(")", 1)[1].split()[1]))
    for pid, (own, parent) in parents.items():
        if own == name and policy in (parent, parents.get(parent, ("", 0))[1]):
            return pid
    raise LookupError(f"no {name} below {policy}")


def measure(fault: str, twin: Any, folder: Path, neutral_us: float) -> dict[str, Any]:
    """One drive with one fault."""
    out = folder / "out"
    if fault == "disk full while recording":
        out = Path(twin.disk) / "out"
    status = twin.status()
    described = {name: status[name] for name in ("i2c", "hall", "camera")}
    described |= {"kind": kind_of(fault), "out": str(out), "lens": str(folder / "lens.yaml")}
    (folder / "twin.json").write_text(json.dumps(described))
    mark = folder / "mark"
    mark.unlink(missing_ok=True)
    twin.reset(3)
    environment = os.environ | {"FAULT": fault, "MARK": str(mark)}
    if fault in COMPUTER:
        (folder / "back").unlink(missing_ok=True)
        environment |= {"LD_PRELOAD": str(library(folder)), CLOCK: str(folder / "back")}
    looks = Looks(twin)
    policy = subprocess.Popen([sys.executable, str(DRIVE), str(folder)], env=environment, stderr=subprocess.PIPE)
    try:
        until = time.monotonic() + 60.0
        while not mark.exists():
            ended = policy.poll() is not None or time.monotonic() > until
            if ended and not mark.exists():
                raise RuntimeError(f"{fault}: the drive did not begin: {policy.communicate()[1].decode()[-2000:]}")
            time.sleep(0.001)
        fault_s = begin(fault, twin, policy.pid, mark, folder)
        wait_for_the_end(looks, fault, policy)
    finally:
        end(fault, twin, policy)
        looks.close()
    summary = out / "summary.json"
    told = json.loads(summary.read_text())["ended_by"] if summary.exists() else ""
    return {"fault": fault, "told": told, **times(looks.rows, fault_s, neutral_us)}


def measure_anyhow(fault: str, twin: Any, folder: Path) -> dict[str, Any]:
    """A drive that begins at the second or third try counts, too: a busy computer may stall the twin's bus before."""
    for left in reversed(range(TRIES)):
        try:
            return measure(fault, twin, folder, neutral_us=1530.0)
        except RuntimeError as error:
            print(error, file=sys.stderr)
            if not left:
                raise
    raise AssertionError


def begin(fault: str, twin: Any, policy: int, mark: Path, folder: Path) -> float:
    """Let a fault begin; its time, s."""
    fault_s = int(mark.read_text() or time.monotonic_ns()) / 1e9
    if fault in SIGNALS:
        who, number = SIGNALS[fault]
        pid, fault_s = pid_of(who, policy), time.monotonic()
        os.kill(pid, number)
    elif fault in COMPUTER:
        fault_s = time.monotonic()
        (folder / "back").touch()
    elif fault in CAR:
        name, rate = CAR[fault]
        fault_s = time.monotonic()
        seconds = BLOCKED_S if fault == "bus blocks for 1 s" else float("inf")
        twin.faults.begin(name, rate=rate, seconds=seconds)
    return fault_s


def wait_for_the_end(looks: Looks, fault: str, policy: subprocess.Popen[bytes]) -> None:
    """Wait until no pulses leave the board for half a second, and the car stands."""
    patience_s = GOES_ON_S if fault in GOES_ON else END_S
    until, quiet_s = time.monotonic() + patience_s, 0.0
    while time.monotonic() < until and quiet_s < 0.5:
        time.sleep(0.05)
        quiet_s = quiet_s + 0.05 if looks.rows[-1][1] == 0.0 and looks.rows[-1][2] < 0.01 else 0.0


def end(fault: str, twin: Any, policy: subprocess.Popen[bytes]) -> None:
    """End the fault and the drive, whatever happened."""
    if fault in CAR:
        twin.faults.end(CAR[fault][0])
    if fault == "SIGSTOP of the keeper":
        os.kill(pid_of("tral-keeper", policy.pid), signal.SIGCONT)
    if policy.poll() is None:
        policy.terminate()
    try:
        policy.wait(5.0)
    except subprocess.TimeoutExpired:
        policy.kill()
        policy.wait()
    if policy.stderr is not None:
        policy.stderr.close()
    time.sleep(1.0)  # the actuator's process ends the pulses, too


def times(rows: list[tuple[float, float, float]], fault_s: float, neutral_us: float) -> dict[str, float | None]:
    """From a fault until no throttle stands for good, and until no pulses, ms; way from then on, m; speed then, m/s."""
    after = [row for row in rows if row[0] >= fault_s]
    drives = [k for k, (_, us, _) in enumerate(after) if us > 0.0 and us < neutral_us - 60.0]
    pulses = [k for k, (_, us, _) in enumerate(after) if us > 0.0]
    way = sum(row[2] * (later[0] - row[0]) for row, later in pairwise(after))

    def last(places: list[int]) -> float | None:
        if not places:
            return 0.0
        return (after[places[-1] + 1][0] - fault_s) * 1e3 if places[-1] + 1 < len(after) else None

    return {"neutral_ms": last(drives), "off_ms": last(pulses), "way_m": way, "speed_mps": after[0][2]}


def car_file(twin: Any, kind: str) -> str:
    """The car file of a twin."""
    if kind in BOARDS:
        port = twin.status()["serial"][kind]
        board = sensors = f'driver = "{kind}"\nport = "{port}"\n'
    else:
        board = (
            f'driver = "pca9685"\nbus = "{twin.i2c_path}"\noscillator_hz = {twin.settings.clock_hz:.0f}\n'
            "clock_measured = true\n"
        )
        sensors = f'driver = "srf08"\nbus = "{twin.i2c_path}"\n'
    head = 'version = 1\nname = "twin"\n'
    return f'{head}\n[board]\n{board}\n[pulses]\nfile = "tt01"\n\n[[sensors]]\n{sensors}'


def row(fault: str, drives: list[dict[str, Any]]) -> str:
    """A row of the table."""
    cells, neutral_ms = [], [each["neutral_ms"] for each in drives]
    drives_on = fault in GOES_ON and all(one is None or one >= GOES_ON_S * 1e3 for one in neutral_ms)
    stays = not drives_on and any(one is None or one > STAYS_MS for one in neutral_ms)
    for name in ("neutral_ms", "off_ms"):
        values = [each[name] for each in drives]
        if drives_on or stays:
            cells.append("drives on" if drives_on else "stays")
        elif name == "off_ms" and kind_of(fault) in BOARDS:
            cells.append("neutral stays")
        else:
            cells.append(f"{statistics.median(values):.0f}, {max(values):.0f} ms")
    way = "-" if drives_on or stays else f"{max(each['way_m'] for each in drives):.2f} m"
    return f"| {fault} | {cells[0]} | {cells[1]} | {way} |"


def table(drives: list[dict[str, Any]]) -> list[str]:
    """All rows of the table that were measured."""
    measured = {fault: [each for each in drives if each["fault"] == fault] for fault in ALL}
    return [row(fault, found) for fault, found in measured.items() if found]


def measure_all(faults: list[str], runs: int, out: Path | None) -> None:
    """Measure faults, those of one car after the other, and print the table."""
    from tral_env.calibration.camera_info import write_camera_info
    from tral_env.config import CameraConfig
    from tral_env.twin.settings import TwinSettings
    from tral_env.twin.twin import Twin
    from tral_fsm.evaluation.files import prepare_folder
    from tral_fsm.evaluation.host import host

    if out is not None:
        prepare_folder(out.parent)
    known = json.loads(out.read_text())["drives"] if out is not None and out.exists() else []
    drives: list[dict[str, Any]] = list(known)
    sys.setswitchinterval(SWITCH_S)
    print("| fault | neutral: median, longest | no pulses: median, longest | way |\n| --- | --- | --- | --- |")
    for kind in dict.fromkeys(map(kind_of, faults)):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            course = {"name": "faults", "segments": [{"length": LENGTH_M}]}
            (folder / "course.json").write_text(json.dumps(course))
            write_camera_info(folder / "lens.yaml", CameraConfig())
            settings = TwinSettings(
                name="faults", scenario="straight", course=str(folder / "course.json"), randomization="none", bus=None,
                board="pca9685" if kind == "camera" else kind, serial=kind in BOARDS, camera=kind == "camera",
                folder=str(folder / "twin"), seed=3,
            )  # fmt: skip
            with Twin(settings) as twin:
                (folder / "car.toml").write_text(car_file(twin, kind))
                for fault in (each for each in faults if kind_of(each) == kind):
                    measured = [each for each in drives if each["fault"] == fault]
                    for _ in range(runs - len(measured)):
                        measured.append(measure_anyhow(fault, twin, folder))
                        drives.append(measured[-1])
                        if out is not None:
                            out.write_text(json.dumps({"host": host(), "drives": drives}, indent=1))
                    print(row(fault, measured), measured[-1]["told"], flush=True)


def main() -> None:
    """Measure all faults, or some."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--faults", default=";".join(ALL))
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    measure_all(given.faults.split(";"), given.runs, given.out)


if __name__ == "__main__":
    main()
