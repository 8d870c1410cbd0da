"""Stand-ins: what counts as one, when it is given up, and that worker and keeper never give a real board up."""

import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from faults import is_gone, wait_until
from rig import MS, OFF, Clock, FakeBoard, Works, settings

from tral_env.hardware.actuator import keeper
from tral_env.hardware.actuator.keeper import Keeper
from tral_env.hardware.actuator.stand_in import GIVEN_UP, StandIn, stand_in
from tral_env.hardware.actuator.wire import ENDED
from tral_env.hardware.actuator.worker import Worker

SECOND = 1000 * MS


@pytest.fixture
def mounts(tmp_path: Path) -> Path:
    """A list of mounts in which the files of the test, and /dev, are on FUSE."""
    lines = []
    for path in (tmp_path, Path("/dev/null")):
        number = path.stat().st_dev
        lines.append(f"36 35 {os.major(number)}:{os.minor(number)} / / rw shared:1 - fuse tral-twin rw\n")
    (tmp_path / "mountinfo").write_text("20 1 0:999 / /proc rw - proc proc rw\n" + "".join(lines))
    return tmp_path / "mountinfo"


@pytest.fixture
def shown(tmp_path: Path, mounts: Path) -> StandIn:
    """The stand-in `i2c-1`."""
    (tmp_path / "i2c-1").touch()
    found = stand_in(str(tmp_path / "i2c-1"), mounts)
    assert found is not None
    return found


def test_a_pseudo_terminal_is_a_stand_in_also_behind_a_link(tmp_path: Path) -> None:
    master, slave = os.openpty()
    (tmp_path / "tty-board").symlink_to(os.ttyname(slave))
    found = stand_in(str(tmp_path / "tty-board"))
    assert found is not None
    assert not found.is_given_up(0)
    os.close(slave)
    os.close(master)
    assert [found.is_given_up(s * SECOND) for s in (1, 10, 11)] == [False, False, True], "missing since second 1"


def test_a_pseudo_terminal_of_another_program_with_the_same_number_is_not_the_one_that_is_open(tmp_path: Path) -> None:
    ends = os.openpty()
    name = os.ttyname(ends[1])
    (tmp_path / "tty-board").symlink_to(name)  # the link of a twin that was killed stays
    found = [stand_in(path) for path in (name, str(tmp_path / "tty-board"))]
    made_ns = Path(name).stat().st_ctime_ns
    while Path(name).stat().st_ctime_ns == made_ns:  # the kernel counts their age in its own ticks
        for end in ends:
            os.close(end)
        ends = os.openpty()
        assert os.ttyname(ends[1]) == name
    for each in found:
        assert each is not None
        assert [each.is_given_up(s * SECOND) for s in (1, 10, 11)] == [False, False, True]
    for end in ends:
        os.close(end)


def test_a_port_that_was_taken_away_and_came_back_is_there_again(tmp_path: Path) -> None:
    link, ends = tmp_path / "tty-board", os.openpty()
    link.symlink_to(os.ttyname(ends[1]))
    found = stand_in(str(link))
    assert found is not None
    for _ in range(2):
        link.unlink()
        assert not found.is_given_up(0)
        for end in ends:
            os.close(end)
        ends = os.openpty()
        link.symlink_to(os.ttyname(ends[1]))
        assert [found.is_given_up(s * SECOND) for s in (5, 20, 40)] == [False] * 3
    for end in ends:
        os.close(end)


def test_a_file_or_a_folder_of_fuse_is_a_stand_in(tmp_path: Path, mounts: Path) -> None:
    assert stand_in(str(tmp_path), mounts) is not None
    assert stand_in(str(mounts), mounts) is not None


def test_other_files_and_devices_are_boards_of_their_own(tmp_path: Path, mounts: Path) -> None:
    (tmp_path / "log").touch()
    assert stand_in("/dev/null") is None
    assert stand_in("/dev/null", mounts) is None, "the kernel has the driver of a device file, whatever shows the file"
    assert stand_in(str(tmp_path / "log")) is None
    assert stand_in(str(tmp_path / "log"), tmp_path / "no-list") is None
    assert stand_in(str(tmp_path / "missing"), mounts) is None


@pytest.mark.parametrize("major", [4, 135, 144, 188])
def test_other_serial_ports_are_boards_of_their_own(major: int, monkeypatch: pytest.MonkeyPatch) -> None:
    real = Path("/dev/null").stat()
    assert stand_in(serial_port(real, major, monkeypatch)) is None


@pytest.mark.parametrize("major", [136, 143])
def test_all_majors_of_pseudo_terminals_are_stand_ins(major: int, monkeypatch: pytest.MonkeyPatch) -> None:
    real = Path("/dev/null").stat()
    assert stand_in(serial_port(real, major, monkeypatch)) is not None


def serial_port(real: os.stat_result, major: int, monkeypatch: pytest.MonkeyPatch) -> str:
    """A device file with a major number."""

    class Found:
        st_mode, st_dev, st_rdev, st_ctime_ns = real.st_mode, real.st_dev, os.makedev(major, 0), real.st_ctime_ns

    monkeypatch.setattr("tral_env.hardware.actuator.stand_in.os.stat", lambda path: Found())
    return "/dev/null"


def test_a_stand_in_that_is_missing_for_ten_seconds_is_given_up(tmp_path: Path, shown: StandIn) -> None:
    (tmp_path / "i2c-1").unlink()
    assert not shown.is_given_up(5 * SECOND)
    assert not shown.is_given_up(15 * SECOND - 1)
    assert shown.is_given_up(15 * SECOND)


def test_a_stand_in_that_came_back_counts_anew(tmp_path: Path, shown: StandIn) -> None:
    (tmp_path / "i2c-1").unlink()
    assert not shown.is_given_up(0)
    (tmp_path / "i2c-1").touch()
    assert not shown.is_given_up(9 * SECOND)
    (tmp_path / "i2c-1").unlink()
    assert not shown.is_given_up(10 * SECOND)
    assert not shown.is_given_up(19 * SECOND)
    assert shown.is_given_up(20 * SECOND)


def test_a_file_of_another_mount_is_not_the_one_that_is_open(tmp_path: Path, shown: StandIn) -> None:
    (tmp_path / "i2c-1").unlink()
    (tmp_path / "i2c-1").symlink_to("/proc/self/stat")
    assert not shown.is_given_up(0)
    assert shown.is_given_up(10 * SECOND)


@pytest.mark.parametrize(("error", "is_given_up"), [(2, True), (107, True), (19, True), (5, False), (13, False)])
def test_a_stand_in_whose_file_cannot_be_looked_at_is_missing_only_if_nothing_is_there(
    shown: StandIn, error: int, is_given_up: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(path: str) -> None:
        raise OSError(error, "")

    monkeypatch.setattr("tral_env.hardware.actuator.stand_in.os.stat", fail)
    shown.is_given_up(0)
    assert shown.is_given_up(10 * SECOND) is is_given_up


class Steps(Clock):
    """A clock that goes on at each look."""

    def __init__(self, ms: int = 100) -> None:
        super().__init__()
        self.step_ns = ms * MS

    def __call__(self) -> int:
        self.now_ns += self.step_ns
        return self.now_ns


@pytest.fixture
def works() -> Iterator[Works]:
    car = Works()
    yield car
    car.close()


def test_a_worker_whose_source_ended_gives_a_stand_in_up(tmp_path: Path, shown: StandIn, works: Works) -> None:
    (tmp_path / "i2c-1").unlink()
    works.source.close()
    works.board.failures = 10**6
    clock = Steps()
    worker = Worker(settings(), works.board, *works.ends, clock, shown=shown)
    assert worker.run() == GIVEN_UP
    assert clock.now_ns - Clock().now_ns >= 10 * SECOND


def test_a_worker_does_not_say_that_the_pulses_of_a_stand_in_ended(
    tmp_path: Path, shown: StandIn, works: Works
) -> None:
    (tmp_path / "i2c-1").unlink()
    works.board.failures = 10**6
    worker = Worker(settings(), works.board, *works.ends, Steps(), shown=shown)
    worker.end()
    assert worker.run() == GIVEN_UP
    words = []
    works.source.setblocking(False)
    while True:
        try:
            words.append(works.source.recv(4096))
        except BlockingIOError:
            break
    assert words
    assert ENDED not in words


def test_a_worker_whose_source_lives_keeps_a_stand_in_that_is_missing(
    tmp_path: Path, shown: StandIn, works: Works
) -> None:
    (tmp_path / "i2c-1").unlink()
    clock = Steps(ms=10)
    begun_ns = clock.now_ns
    works.board.failures = 10**6
    works.source.send(b"a packet that nobody takes wakes each turn")

    def recv(size: int) -> bytes:
        if clock.now_ns - begun_ns >= 20 * SECOND:
            return b""  # the policy ends
        works.keeper.send(b".")
        raise BlockingIOError

    commands: Any = Socket(works.ends[0], recv)
    worker = Worker(settings(hang_s=0.5), works.board, commands, works.ends[1], clock, shown=shown)
    assert worker.run() == GIVEN_UP
    assert clock.now_ns - begun_ns >= 30 * SECOND


class Socket:
    """A socket that receives in a way of its own."""

    def __init__(self, real: socket.socket, recv: Callable[[int], bytes]) -> None:
        self._real, self.recv = real, recv

    def __getattr__(self, name: str) -> Any:
        return getattr(self._real, name)


def test_a_worker_ends_the_pulses_of_a_stand_in_that_is_there(shown: StandIn, works: Works) -> None:
    works.source.close()
    worker = Worker(settings(), works.board, *works.ends, Steps(), shown=shown)
    assert worker.run() == 0
    assert works.board.stands == OFF


def test_a_worker_never_gives_up_a_board_of_its_own(tmp_path: Path, works: Works) -> None:
    works.source.close()
    works.board.failures = 400
    clock = Steps()
    worker = Worker(settings(), works.board, *works.ends, clock, shown=stand_in(str(tmp_path / "unplugged")))
    assert worker.run() == 0
    assert clock.now_ns - Clock().now_ns > 60 * SECOND
    assert works.board.stands == OFF


class Watched:
    """A keeper of a child that ended with a status."""

    def __init__(self, status: int, shown: StandIn | None) -> None:
        self.child = subprocess.Popen([sys.executable, "-S", "-c", f"raise SystemExit({status})"])
        wait_until(lambda: is_gone(self.child.pid))
        self.clock = Clock()
        self.board = FakeBoard(self.clock)
        self.source, commands = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        worker, ours = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        worker.close()
        self.keeper = Keeper(
            settings(), self.board, commands, ours, self.child.pid, self.clock, self.clock.sleep, shown=shown
        )
        self.ends = self.source, commands, ours

    def close(self) -> None:
        self.child.wait()
        for each in self.ends:
            each.close()


def test_a_keeper_takes_it_as_final_that_its_worker_gave_a_stand_in_up(
    shown: StandIn, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    case = Watched(GIVEN_UP, shown)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        assert case.keeper.run() == GIVEN_UP != 0
        assert [manager.recv(64) for _ in range(2)] == [b"READY=1", b"WATCHDOG_USEC=0"]
    assert case.board.done == [], "it does not try by itself"
    assert "the pulses were not ended: /dev/null is no board but a stand-in" in capfd.readouterr().err
    case.close()


def test_a_keeper_of_a_board_of_its_own_ends_the_pulses_whatever_status_its_worker_had() -> None:
    case = Watched(GIVEN_UP, None)
    assert case.keeper.run() == 0
    assert case.board.stands == OFF
    case.close()


def test_a_keeper_that_tries_by_itself_gives_a_stand_in_up_too(
    tmp_path: Path, shown: StandIn, capfd: pytest.CaptureFixture[str]
) -> None:
    case = Watched(1, shown)
    (tmp_path / "i2c-1").unlink()
    case.board.failures = 10**6
    assert case.keeper.run() == GIVEN_UP
    assert case.clock.now_ns - Clock().now_ns == 10 * SECOND
    told = capfd.readouterr().err
    assert "is no board but a stand-in" in told
    assert "the keeper has ended the pulses" not in told
    case.source.setblocking(False)
    with pytest.raises(BlockingIOError):
        case.source.recv(4096)
    case.close()


def test_a_keeper_that_tries_by_itself_ends_the_pulses_of_a_stand_in_that_came_back(shown: StandIn) -> None:
    case = Watched(1, shown)
    case.board.failures = 3000
    assert case.keeper.run() == 0
    assert case.board.stands == OFF
    case.close()


def test_a_lock_on_a_file_of_a_dead_mount_does_not_change_the_exit_status(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def close(file: int) -> None:
        real(file)
        raise OSError(107, "Transport endpoint is not connected")

    real = os.close
    monkeypatch.setattr(keeper, "_fork", lambda *_: GIVEN_UP)
    monkeypatch.setattr(keeper.rights, "name", lambda _: None)
    source, commands = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    given = replace(settings(), bus=str(tmp_path / "log"))
    (tmp_path / "log").touch()
    monkeypatch.setattr(keeper.os, "close", close)
    with source:
        assert keeper.main([str(commands.detach()), given.to_json()]) == GIVEN_UP
    monkeypatch.setattr(keeper.os, "close", real)


@pytest.fixture(autouse=True)
def signals(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tests keep their handlers."""
    monkeypatch.setattr(keeper.signal, "signal", lambda *_: None)
