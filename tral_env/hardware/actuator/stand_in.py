"""Devices that a program shows in place of a board: pseudo-terminals, and files of FUSE. The twin has both.

A board whose plug fell out may touch again, so worker and keeper never give it up. When the program behind a stand-in
has ended, no wheel turns, and nobody is left that could take the end of the pulses.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import NamedTuple

from tral_env.hardware.actuator.wire import NS

GIVEN_UP = 3
"""Exit status of a worker or keeper that gave a stand-in up: the pulses were not ended."""
_GONE_S = 10.0
"""A stand-in whose file is missing for this long is given up, s: a fault of the twin that takes its port away is over
by then."""
_PTY_MAJORS = range(136, 144)
"""Major numbers of pseudo-terminals. Source: Documentation/admin-guide/devices.txt of the kernel."""
_MISSING = (errno.ENOENT, errno.ENOTCONN, errno.ENODEV)


class StandIn:
    """A device file that a program shows."""

    def __init__(self, path: str) -> None:
        """Note which device file it is.

        Raises:
            OSError: it is not there.
        """
        self._path = path
        self._link, self._device = _seen(path)
        self._missing_ns: int | None = None
        """It is missing since then."""

    def is_given_up(self, now_ns: int) -> bool:
        """Look whether the file is there; True: it has been missing at each look for too long."""
        if not self._is_missing():
            self._missing_ns = None
            return False
        self._missing_ns = now_ns if self._missing_ns is None else self._missing_ns
        return now_ns - self._missing_ns >= _GONE_S * NS

    def _is_missing(self) -> bool:
        """Whether no file is there, or another one than before: the open one is as dead then.

        Behind a new link stands the same port again: it was taken away and came back.
        """
        try:
            link, device = _seen(self._path)
        except OSError as error:
            return error.errno in _MISSING
        if link != self._link and device.file_system == self._device.file_system:
            self._link, self._device = link, device
        return device != self._device


class _Device(NamedTuple):
    file_system: int
    made_ns: int
    """When a pseudo-terminal was made, ns: a number that is free is given to another one. 0: it is none."""


def _seen(path: str) -> tuple[tuple[int, int], _Device]:
    """The link at a path, (0, 0) without one, and the device that it leads to.

    Raises:
        OSError: nothing is there.
    """
    found, link = os.stat(path), os.lstat(path)  # noqa: PTH116
    device = _Device(found.st_dev, found.st_ctime_ns if stat.S_ISCHR(found.st_mode) else 0)
    return (link.st_ino, link.st_ctime_ns) if stat.S_ISLNK(link.st_mode) else (0, 0), device


def stand_in(path: str, mounts: Path = Path("/proc/self/mountinfo")) -> StandIn | None:
    """The stand-in behind a path; None: a board of its own, or nobody can tell.

    Args:
        path: device file, or folder of device files.
        mounts: list of the mounts, see proc_pid_mountinfo(5).
    """
    try:
        found = os.stat(path)  # noqa: PTH116
        is_pty = stat.S_ISCHR(found.st_mode) and os.major(found.st_rdev) in _PTY_MAJORS
        is_shown = is_pty or (not stat.S_ISCHR(found.st_mode) and _is_fuse(found.st_dev, mounts))
        return StandIn(path) if is_shown else None
    except OSError:
        return None


def _is_fuse(file_system: int, mounts: Path) -> bool:
    """Whether a file system, by its number, is one of FUSE."""
    number = f"{os.major(file_system)}:{os.minor(file_system)}"
    for line in mounts.read_text(errors="replace").splitlines():
        where, _, what = line.partition(" - ")
        if where.split()[2] == number and what.startswith("fuse"):
            return True
    return False
