"""The keeper: what it does when the worker dies, hangs, or ends well. The board and the clock are fakes."""

import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fakes import FakeSmbus, Pca9685Fake
from faults import is_gone, wait_until
from rig import MS, NEUTRAL, OFF, Clock, FakeBoard, Works, settings

from tral_env.hardware.actuator.keeper import Keeper, main, notify, switch_off
from tral_env.hardware.actuator.wire import Reason, State, read_reply
from tral_env.hardware.actuator.worker import Worker


@pytest.fixture(autouse=True)
def signals() -> Iterator[None]:
    """Give back the handler of SIGTERM."""
    before = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, before)


class Watch:
    """A keeper of a child that runs a program; the child does not touch the sockets."""

    def __init__(self, program: str) -> None:
        self.child = subprocess.Popen([sys.executable, "-S", "-c", program])
        self.clock = Clock()
        self.board = FakeBoard(self.clock)
        self.source, commands = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.worker, ours = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.ours = commands, ours
        self.keeper = Keeper(
            settings(hang_s=0.05), self.board, commands, ours, self.child.pid, self.clock, self.clock.sleep
        )

    def close(self) -> None:
        self.child.kill()
        self.child.wait()
        for each in (self.source, self.worker, *self.ours):
            each.close()


@pytest.fixture
def watch() -> Iterator[Any]:
    opened = []

    def make(program: str) -> Watch:
        opened.append(Watch(program))
        return opened[-1]

    yield make
    for each in opened:
        each.close()


def since_ms(board: FakeBoard) -> list[tuple[float, str]]:
    return [((ns - Clock().now_ns) / MS, method) for ns, method, _ in board.done]


def test_a_worker_without_a_sign_of_life_is_killed_then_neutral_then_off(watch: Any) -> None:
    case = watch("import time; time.sleep(60)")
    assert case.keeper.run() == 0
    assert case.child.wait() != 1
    done = since_ms(case.board)
    assert done[0] == (0.0, "pulses")
    assert done[-1] == (400.0, "off")
    assert {pulses for _, method, pulses in case.board.done if method == "pulses"} == {NEUTRAL}
    reply = read_reply(case.source.recv(4096))
    assert reply is not None
    assert (reply.state, reply.reason, reply.throttle_us) == (State.LATCHED, Reason.WORKER, 1500.0)


def test_a_worker_that_ended_well_leaves_nothing_to_do(watch: Any) -> None:
    case = watch("pass")
    wait_until(lambda: is_gone(case.child.pid))
    case.worker.close()
    assert case.keeper.run() == 0
    assert case.board.done == []


@pytest.mark.parametrize("program", ["raise SystemExit(1)", "import os; os.kill(os.getpid(), 9)"])
def test_a_worker_that_failed_or_died_is_followed_by_neutral_and_off(watch: Any, program: str) -> None:
    case = watch(program)
    wait_until(lambda: is_gone(case.child.pid))
    case.worker.close()
    assert case.keeper.run() == 0
    assert case.board.done[0][2] == NEUTRAL
    assert case.board.stands == OFF


def test_a_sign_of_life_is_answered_and_fed_to_the_service_manager(
    watch: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = watch("pass")
    wait_until(lambda: is_gone(case.child.pid))
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "1000000")
        for _ in range(3):
            case.worker.send(b".")
        case.worker.shutdown(socket.SHUT_WR)
        assert case.keeper.run() == 0
        assert [case.worker.recv(8) for _ in range(3)] == [b"."] * 3
        begin, fed, end = (manager.recv(64) for _ in range(3))
        assert (begin, fed, end) == (b"READY=1\nWATCHDOG_USEC=1000000", b"WATCHDOG=1", b"WATCHDOG_USEC=0")
        manager.setblocking(False)
        with pytest.raises(BlockingIOError):
            manager.recv(64)


def test_the_pulses_are_ended_as_soon_as_the_board_takes_it(watch: Any) -> None:
    case = watch("pass")
    case.board.failures = 200
    assert case.keeper.end_pulses()
    assert since_ms(case.board) == [(2000.0, "off")]


def test_neutral_is_told_once_and_tried_again(watch: Any) -> None:
    case = watch("pass")
    case.board.failures = 2
    assert case.keeper.end_pulses()
    assert since_ms(case.board)[0] == (20.0, "pulses")
    assert read_reply(case.source.recv(4096)) is not None
    case.source.setblocking(False)
    with pytest.raises(BlockingIOError):
        case.source.recv(4096)


def test_a_board_that_never_answers_is_given_up_and_told(watch: Any, capsys: pytest.CaptureFixture[str]) -> None:
    case = watch("import time; time.sleep(60)")
    case.board.failures = 10**9
    assert case.keeper.run() == 1
    assert "cut the power of the motor" in capsys.readouterr().err


def test_nobody_to_tell_is_no_reason_to_stop(watch: Any) -> None:
    case = watch("pass")
    case.source.close()
    assert case.keeper.end_pulses()
    assert case.board.stands == OFF


def test_the_service_manager_is_told(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        path = str(tmp_path / "notify")
        manager.bind(path)
        monkeypatch.setenv("NOTIFY_SOCKET", path)
        notify({"READY": "1", "STATUS": "stands"})
        assert manager.recv(100) == b"READY=1\nSTATUS=stands"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(b"\0tral-test-notify")
        monkeypatch.setenv("NOTIFY_SOCKET", "@tral-test-notify")
        notify({"WATCHDOG": "1"})
        assert manager.recv(100) == b"WATCHDOG=1"
    notify({"WATCHDOG": "1"})  # a manager that is gone is no error
    monkeypatch.delenv("NOTIFY_SOCKET")
    notify({"WATCHDOG": "1"})


def test_the_outputs_of_a_board_can_be_switched_off_from_a_shell(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    smbus2 = pytest.importorskip("smbus2")
    opened = []

    def open_bus(number: object) -> FakeSmbus:
        opened.append((number, FakeSmbus({0x41: Pca9685Fake()})))
        return opened[-1][1]

    monkeypatch.setattr(smbus2, "SMBus", open_bus)
    assert switch_off(["3", "0x41"]) == 0
    assert (opened[0][0], opened[0][1].log) == (3, [(0x41, 0xFD, (0x10,))])
    assert switch_off([]) == 1
    assert "PCA9685 at 0x40 on /dev/i2c-1: no answer" in capsys.readouterr().err


def test_a_board_that_cannot_be_opened_is_told_to_the_source(tmp_path: Any) -> None:
    source, commands = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with source:
        given = settings()
        given = type(given)(**{**vars(given), "bus": str(tmp_path / "missing" / "log")})
        handlers = {each: signal.getsignal(each) for each in IGNORED}
        try:
            assert main([str(commands.detach()), given.to_json()]) == 1
        finally:
            for each, handler in handlers.items():
                signal.signal(each, handler)
        assert b"No such file" in source.recv(4096)


IGNORED = (signal.SIGINT, signal.SIGHUP, signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)


class Hurry(Clock):
    """A clock that jumps at each look."""

    def __init__(self, ms: float) -> None:
        super().__init__()
        self.ms = ms

    def __call__(self) -> int:
        self.now_ns += round(self.ms * MS)
        return self.now_ns


@pytest.mark.parametrize(("failures", "status"), [(0, 0), (10**9, 1)])
def test_a_worker_ends_when_its_source_did(failures: int, status: int) -> None:
    car = Works()
    car.source.close()
    car.board.failures = failures
    worker = Worker(settings(), car.board, *car.ends, clock_ns=Hurry(30.0 if status == 0 else 500.0))
    assert worker.run() == status
    assert worker.guard.reason is Reason.LOST
    assert signal.getsignal(signal.SIGTERM) == worker.end
    assert (car.board.stands == OFF) is (status == 0)
    car.close()


def test_sockets_that_break_count_as_ended() -> None:
    class Broken:
        def recv(self, size: int) -> bytes:
            raise ConnectionResetError

        def send(self, packet: bytes) -> int:
            raise BrokenPipeError

    car = Works()
    broken: Any = Broken()
    worker = Worker(settings(), car.board, broken, broken, car.clock)
    assert worker.turn(True, True) == [broken, broken]
    assert worker.guard.reason is Reason.LOST
    car.close()


def test_a_socket_that_woke_for_nothing_is_no_end() -> None:
    car = Works()
    car.keeper_lives = False
    assert car.worker.turn(True, True) == []
    car.send()
    assert car.turn() == []
    car.close()
