"""What the operating system grants, and what it tells about containers."""

import ctypes
import os
import resource
from pathlib import Path
from typing import Any

import pytest

from tral_env.hardware.actuator import rights


def test_what_is_not_granted_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    class Refusing:
        def mlockall(self, flags: int) -> int:
            return -1

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(Path, "write_text", refuse)
    monkeypatch.setattr(ctypes, "CDLL", lambda _: Refusing())
    assert rights.claim() == {"realtime": False, "locked": False, "spared": False}


@pytest.mark.parametrize(("limit", "flags"), [(resource.RLIM_INFINITY, 3), (65536, 1)])
def test_what_is_granted_is_told(monkeypatch: pytest.MonkeyPatch, limit: int, flags: int) -> None:
    class Granting:
        def mlockall(self, wanted: int) -> int:
            locked.append(wanted)
            return 0

    locked: list[int] = []
    scheduled: list[Any] = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda *given: scheduled.append(given))
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (limit, limit))
    monkeypatch.setattr(Path, "write_text", lambda *_: 5)
    monkeypatch.setattr(ctypes, "CDLL", lambda _: Granting())
    assert rights.claim() == {"realtime": True, "locked": True, "spared": True}
    assert (scheduled[0][1], locked) == (os.SCHED_FIFO, [flags])


def test_a_process_can_be_named() -> None:
    before = Path("/proc/self/comm").read_text().strip()
    rights.name("tral-test")
    assert Path("/proc/self/comm").read_text() == "tral-test\n"
    rights.name(before)


def test_a_pid_namespace_that_is_not_the_computers_own_is_a_container(tmp_path: Path) -> None:
    (tmp_path / "pid").touch()
    assert rights.in_container(tmp_path / "pid")
    assert rights.in_container(tmp_path / "missing"), "nothing is known"
