"""What the operating system may grant: real-time priority, locked memory, not to be the first to go without memory."""

from __future__ import annotations

import ctypes
import os
import resource
from pathlib import Path

PRIORITY = 60
"""Real-time priority, above the kernel's threaded interrupts at 50: a policy that fills all cores cannot starve it."""
_CURRENT, _FUTURE = 1, 2
"""Flags of mlockall."""
_SET_NAME = 15
"""PR_SET_NAME of prctl(2)."""
_INITIAL_PID_NAMESPACE = 0xEFFFFFFC
"""Inode of the computer's own PID namespace: PROC_PID_INIT_INO of the kernel."""


def claim() -> dict[str, bool]:
    """Take what is allowed; what is not is False, and no error."""
    return {"realtime": _realtime(), "locked": _locked(), "spared": _spared()}


def name(text: str) -> None:
    """Name this process for `ps` and `killall`, in 15 letters at most: ``killall python`` must not find it."""
    ctypes.CDLL(None).prctl(_SET_NAME, text.encode(), 0, 0, 0)


def in_container(namespace: Path = Path("/proc/self/ns/pid")) -> bool:
    """Whether the processes of a PID namespace are all killed when its first one ends, this one among them.

    Args:
        namespace: file of the PID namespace; where it cannot be read, nothing is known, which counts as yes.
    """
    try:
        return namespace.stat().st_ino != _INITIAL_PID_NAMESPACE
    except OSError:
        return True


def _realtime() -> bool:
    """Real-time priority, which a fork inherits."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except OSError:
        return False
    return True


def _locked() -> bool:
    """Keep all memory in RAM, so that no access waits for a disk; a fork does not inherit it.

    With a limit on locked memory, what is allocated later stays unlocked: beyond the limit, allocating would fail.
    """
    unlimited = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY or os.geteuid() == 0
    flags = _CURRENT | _FUTURE if unlimited else _CURRENT
    return int(ctypes.CDLL(None).mlockall(flags)) == 0


def _spared() -> bool:
    """Let the kernel kill any other process first when memory runs out."""
    try:
        Path("/proc/self/oom_score_adj").write_text("-1000")
    except OSError:
        return False
    return True
