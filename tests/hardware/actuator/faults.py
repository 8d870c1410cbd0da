"""Faults of real processes, injected while the car drives, and the times until neutral and until no pulses.

`python tests/hardware/actuator/faults.py [RUNS [FAULT ...]]` prints the table of docs/safety.md.
"""

from __future__ import annotations

import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from rig import NEUTRAL, OFF, SETTINGS

from tral_env.hardware.actuator.settings import Limits, Settings

HERE = Path(__file__).resolve()
QUICK = Limits(arming_s=0.05, evidence_s=None)
DRIVING_S = 0.15
END_S = 8.0
"""A fault has ended the pulses after this time, or it never will."""

POLICY = """
import ctypes, os, signal, sys, time, types
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell lets its background jobs ignore these two
signal.signal(signal.SIGHUP, signal.SIG_DFL)
bare = types.ModuleType("tral_env")
bare.__path__ = [sys.argv[1]]
sys.modules["tral_env"] = bare
from tral_env.hardware.actuator.client import ActuatorProcess
from tral_env.hardware.actuator.settings import Settings
exec(sys.argv[5])
actuator = ActuatorProcess(Settings.from_json(sys.argv[2]))
actuator.arm()
observations = 0
def drive(seconds, throttle=0.5, seeing=True):
    global observations
    for _ in range(round(seconds * 80)):
        observations += seeing
        actuator.command(0.0, throttle, observations)
        time.sleep(0.0125)
        actuator.check()
drive(float(sys.argv[4]))
print(actuator.hello["worker"], actuator.hello["keeper"], time.monotonic_ns(), flush=True)
exec(sys.argv[3])
"""
"""The policy's process: arguments are the package's folder, settings, the fault as a program, time to drive, s,
and what it does before it opens the car, as a program."""

PROGRAMS = {
    "exception": "raise RuntimeError('a policy failed')",
    "os.abort": "os.abort()",
    "sys.exit": "sys.exit(3)",
    "busy loop": "while True: pass",
    "C code that holds the GIL": "ctypes.PyDLL(None).sleep(60)",
    "SIGKILL of a policy whose fork lives on": "os.fork() and os.kill(os.getpid(), 9) or time.sleep(1)",
    "NaN commands": "drive(60, throttle=float('nan'))",
    "observations frozen": "drive(60, seeing=False)",
}
"""Faults that the policy commits itself."""

SIGNALS = {
    "SIGKILL of the policy": ("policy", signal.SIGKILL),
    "SIGSTOP of the policy": ("policy", signal.SIGSTOP),
    "SIGTERM of the policy": ("policy", signal.SIGTERM),
    "SIGINT of the policy": ("policy", signal.SIGINT),
    "SIGHUP of the policy": ("policy", signal.SIGHUP),
    "SIGKILL of the worker": ("worker", signal.SIGKILL),
    "SIGSTOP of the worker": ("worker", signal.SIGSTOP),
    "SIGTERM of the worker": ("worker", signal.SIGTERM),
    "SIGKILL of the keeper": ("keeper", signal.SIGKILL),
    "SIGSTOP of the keeper": ("keeper", signal.SIGSTOP),
    "SIGTERM of the keeper": ("keeper", signal.SIGTERM),
    "SIGKILL of the worker, the policy ignores SIGCHLD": ("worker", signal.SIGKILL),
    "SIGSTOP of the worker, the policy ignores SIGCHLD": ("worker", signal.SIGSTOP),
    "SIGTERM of the worker, the policy blocks all signals": ("worker", signal.SIGTERM),
    "SIGTERM of the keeper, the policy blocks all signals": ("keeper", signal.SIGTERM),
}
"""Faults that come from outside, while the policy goes on driving if it can."""

BEFORE = {
    "ignores SIGCHLD": "signal.signal(signal.SIGCHLD, signal.SIG_IGN)",
    "blocks all signals": "signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())",
}
"""What a policy does before it opens the car, by the end of a fault's name."""


def pulses_in(log: Path) -> list[tuple[int, tuple[float, float]]]:
    """Times, ns, and pulses, us, that the driver "log" wrote."""
    rows = [line.split() for line in log.read_text().splitlines()]
    return [(int(row[0]), (float(row[1]), float(row[2]))) for row in rows if len(row) == 3]


def times_ms(log: Path, fault_ns: int) -> tuple[float, float]:
    """Times from a fault until neutral stands for good, and until no pulses stand for good, ms."""
    rows = pulses_in(log)
    assert rows[-1][1] == OFF, f"pulses stand: {rows[-1]}"
    driven = [i for i, (_, pulses) in enumerate(rows) if pulses not in (NEUTRAL, OFF)]
    off = next(i for i in reversed(range(len(rows))) if rows[i - 1][1] != OFF)
    assert driven[-1] + 1 < len(rows)
    return (rows[driven[-1] + 1][0] - fault_ns) / 1e6, (rows[off][0] - fault_ns) / 1e6


def has_ended(log: Path) -> bool:
    """Whether the last pulses that were written are none."""
    rows = pulses_in(log)
    return bool(rows) and rows[-1][1] == OFF


def wait_until(happened: Callable[[], bool], seconds: float = END_S) -> None:
    """Wait, though not for ever."""
    until = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < until, f"not within {seconds:g} s"
        time.sleep(0.01)


def is_gone(pid: int) -> bool:
    """Whether a process has ended; a zombie has."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


def measure(fault: str, folder: Path, settings: Settings | None = None) -> tuple[float, float]:
    """Let a policy drive, commit a fault, and wait for the end of the pulses.

    Returns:
        Times until neutral and until no pulses, ms.
    """
    log = folder / "pulses.log"
    given = settings or replace(SETTINGS, bus=str(log), limits=QUICK)
    if fault == "observations frozen":
        given = replace(given, limits=replace(QUICK, evidence_s=1.0))
    program = PROGRAMS.get(fault, "drive(60)")
    before = next((text for name, text in BEFORE.items() if fault.endswith(name)), "")
    arguments = [str(HERE.parents[3] / "tral_env"), given.to_json(), program, str(DRIVING_S), before]
    policy = subprocess.Popen(
        [sys.executable, "-I", "-c", POLICY, *arguments], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert policy.stdout is not None
    with policy, policy.stdout:
        worker, keeper, fault_ns = (int(word) for word in policy.stdout.readline().split())
        try:
            if fault in SIGNALS:
                who, number = SIGNALS[fault]
                time.sleep(0.05)
                fault_ns = time.monotonic_ns()
                os.kill({"policy": policy.pid, "worker": worker, "keeper": keeper}[who], number)
            wait_until(lambda: has_ended(log))
        finally:
            policy.kill()
            if fault == "SIGSTOP of the keeper":
                os.kill(keeper, signal.SIGCONT)
        wait_until(lambda: is_gone(worker) and is_gone(keeper))
    return times_ms(log, fault_ns)


def main(runs: int = 5, *only: str) -> None:
    """Print a table: fault, median and longest time until neutral and until no pulses, ms."""
    print("| fault | neutral: median, longest | no pulses: median, longest |\n| --- | --- | --- |")
    for fault in only or [*PROGRAMS, *SIGNALS]:
        measured = []
        for _ in range(runs):
            with tempfile.TemporaryDirectory() as folder:
                measured.append(measure(fault, Path(folder)))
        columns = [f"{statistics.median(each):.0f}, {max(each):.0f} ms" for each in zip(*measured, strict=True)]
        print(f"| {fault} | {' | '.join(columns)} |", flush=True)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:2]), *sys.argv[2:])
