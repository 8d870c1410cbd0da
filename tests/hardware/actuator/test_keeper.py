"""The keeper: what it does when the worker dies, hangs, or ends well. The board and the clock are fakes."""

import fcntl
import json
import os
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from fakes import FakeSmbus, Pca9685Fake
from faults import is_gone, wait_until
from rig import MS, NEUTRAL, OFF, Clock, FakeBoard, Works, settings

from tral_env.hardware.actuator import keeper
from tral_env.hardware.actuator.keeper import Keeper, main, notify, own_signals, switch_off
from tral_env.hardware.actuator.settings import Settings
from tral_env.hardware.actuator.wire import ENDED, Reason, Refusal, Reply, State, read_reply
from tral_env.hardware.actuator.worker import Worker


@pytest.fixture(autouse=True)
def signals() -> Iterator[None]:
    """Give back the handlers."""
    before = {number: signal.getsignal(number) for number in signal.valid_signals()}
    yield
    for number, handler in before.items():
        if handler is not None and signal.getsignal(number) != handler:
            signal.signal(number, handler)


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
    told_ns = Clock().now_ns
    died = Reply(State.LATCHED, Reason.WORKER, Refusal.NONE, 0, told_ns, 0.0, 0.0, *NEUTRAL, 0, 0, 0, 0)
    assert read_reply(case.source.recv(4096)) == died


def test_a_worker_is_given_the_time_of_the_settings_for_a_sign_of_life(
    watch: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Poll:
        def register(self, *_: Any) -> None:
            pass

        def poll(self, timeout_ms: float) -> list[Any]:
            waited_ms.append(timeout_ms)
            return []

    waited_ms: list[float] = []
    case = watch("pass")
    monkeypatch.setattr(keeper.select, "poll", Poll)
    assert case.keeper.run() == 0
    assert waited_ms[:2] == [50.0, 20.0], "then for its death"
    assert case.board.stands == OFF


def test_a_killed_worker_is_gone_before_the_keeper_writes(watch: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keeper, "_DEATH_S", 30.0)
    case = watch("import time; time.sleep(60)")
    monkeypatch.setattr(case.board, "set_pulses", lambda *_: gone.append(not Path(f"/proc/{case.child.pid}").exists()))
    gone: list[bool] = []
    assert case.keeper.run() == 0
    assert set(gone) == {True}


def test_the_last_word_of_a_keeper_is_that_the_pulses_have_ended(watch: Any) -> None:
    case = watch("raise SystemExit(1)")
    wait_until(lambda: is_gone(case.child.pid))
    case.worker.close()
    assert case.keeper.run() == 0
    words = [case.source.recv(4096) for _ in range(2)]
    assert words[1] == ENDED


def test_a_worker_that_ended_well_leaves_nothing_to_do(watch: Any) -> None:
    case = watch("pass")
    wait_until(lambda: is_gone(case.child.pid))
    case.worker.close()
    assert case.keeper.run() == 0
    assert case.board.done == []


@pytest.mark.parametrize("program", ["raise SystemExit(1)", "import os; os.kill(os.getpid(), 9)"])
def test_a_worker_that_failed_or_died_is_followed_by_neutral_and_off(
    watch: Any, program: str, capfd: pytest.CaptureFixture[str]
) -> None:
    case = watch(program)
    wait_until(lambda: is_gone(case.child.pid))
    case.worker.close()
    assert case.keeper.run() == 0
    assert case.board.done[0][2] == NEUTRAL
    assert case.board.stands == OFF
    assert "the worker died or stood still; the keeper has ended the pulses" in capfd.readouterr().err


def test_the_service_manager_watches_no_more_when_the_keeper_has_ended_the_pulses(
    watch: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = watch("raise SystemExit(1)")
    wait_until(lambda: is_gone(case.child.pid))
    case.worker.close()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        assert case.keeper.run() == 0
        assert [manager.recv(64) for _ in range(2)] == [b"READY=1", b"WATCHDOG_USEC=0"]


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


def test_the_service_manager_hears_of_life_several_times_within_its_second(
    watch: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = watch("pass")
    wait_until(lambda: is_gone(case.child.pid))
    monkeypatch.setattr(case.keeper, "_clock_ns", Hurry(20.0))
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        for _ in range(50):
            case.worker.send(b".")
        case.worker.shutdown(socket.SHUT_WR)
        assert case.keeper.run() == 0
        manager.setblocking(False)
        words = []
        with suppress(BlockingIOError):
            while True:
                words.append(manager.recv(64))
    assert 8 <= words.count(b"WATCHDOG=1") <= 10


def test_the_pulses_are_ended_as_soon_as_the_board_takes_it(watch: Any) -> None:
    case = watch("pass")
    case.board.failures = 200
    case.keeper.end_pulses()
    assert since_ms(case.board) == [(2000.0, "off")]


def test_the_keeper_never_gives_up_a_board_that_may_come_back(watch: Any, capfd: pytest.CaptureFixture[str]) -> None:
    case = watch("pass")
    case.board.failures = 9000
    case.keeper.end_pulses()
    assert since_ms(case.board) == [(pytest.approx(630_000.0), "off")], "30 s at 10 ms, then every 100 ms"
    assert capfd.readouterr().err.count("cut the power of the motor") == 1


@pytest.mark.parametrize(("refuses_s", "complaints"), [(0.9, 0), (1.5, 1)])
def test_a_board_that_refuses_for_more_than_a_second_is_told(
    watch: Any, capfd: pytest.CaptureFixture[str], refuses_s: float, complaints: int
) -> None:
    case = watch("pass")
    case.board.failures = round(refuses_s * 100)
    case.keeper.end_pulses()
    assert capfd.readouterr().err.count("THE PULSES COULD NOT BE ENDED YET") == complaints


def test_a_driver_that_fails_in_its_own_way_does_not_end_the_keeper(watch: Any) -> None:
    case = watch("pass")
    case.board.failures, case.board.error = 5, ValueError("a short answer")
    case.keeper.end_pulses()
    assert [since_ms(case.board)[0], since_ms(case.board)[-1]] == [(50.0, "pulses"), (400.0, "off")]


@pytest.mark.parametrize("program", ["import os; os.kill(os.getpid(), 9)", "import time; time.sleep(60)"])
def test_a_worker_that_the_kernel_took_away_is_followed_by_neutral_and_off(watch: Any, program: str) -> None:
    """As where the policy ignores SIGCHLD and the keeper had inherited that."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    case = watch(program)
    if "kill" in program:
        wait_until(lambda: not Path(f"/proc/{case.child.pid}").exists())
        case.worker.close()
    assert case.keeper.run() == 0
    assert case.board.done[0][2] == NEUTRAL
    assert case.board.stands == OFF


def test_whatever_fails_in_the_keeper_the_pulses_end(
    watch: Any, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    case = watch("import time; time.sleep(60)")
    monkeypatch.setenv("NOTIFY_SOCKET", "/run/notify")
    real, calls = socket.socket, []

    def fails(*arguments: Any, **named: Any) -> socket.socket:
        calls.append(1)
        if len(calls) == 1:
            raise MemoryError
        return real(*arguments, **named)

    monkeypatch.setattr(keeper.socket, "socket", fails)
    assert case.keeper.run() == 0
    assert case.board.stands == OFF
    assert "MemoryError" in capfd.readouterr().err


def test_a_worker_that_reads_nothing_does_not_block_the_keeper(watch: Any) -> None:
    case = watch("pass")
    case.ours[1].setblocking(False)
    case.ours[1].setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)
    for _ in range(50):
        case.worker.send(b".")
    case.worker.shutdown(socket.SHUT_WR)
    wait_until(lambda: is_gone(case.child.pid))
    assert case.keeper.run() == 0
    assert case.board.done == []


@pytest.mark.parametrize(("status", "methods"), [(0, set()), (1, {"pulses", "off"})])
def test_a_socket_that_breaks_is_the_end_of_the_worker(watch: Any, status: int, methods: set[str]) -> None:
    case = watch(f"raise SystemExit({status})")
    wait_until(lambda: is_gone(case.child.pid))
    case.worker.send(b".")
    case.worker.close()
    assert case.keeper.run() == 0
    assert {method for _, method, _ in case.board.done} == methods


def test_a_terminal_that_blocks_does_not_keep_the_keeper(watch: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    read_end, write_end = os.pipe()
    os.write(write_end, bytes(fcntl.fcntl(write_end, fcntl.F_SETPIPE_SZ, 4096)))
    monkeypatch.setattr(keeper, "_STDERR", write_end)
    case = watch("pass")
    case.board.failures = 200
    case.keeper.end_pulses()
    assert case.board.stands == OFF
    os.close(read_end)
    os.close(write_end)


@pytest.mark.parametrize("told", [True, False])
def test_a_signal_is_handed_on_to_the_worker(watch: Any, monkeypatch: pytest.MonkeyPatch, told: bool) -> None:
    sent: list[int] = []
    real = signal.pidfd_send_signal

    def send(process: int, number: int) -> None:
        sent.append(number)
        real(process, number)

    case = watch("import time; time.sleep(60)")
    monkeypatch.setattr(keeper.signal, "pidfd_send_signal", send)
    if told:
        case.keeper.end()
    case.worker.send(b".")
    case.worker.shutdown(socket.SHUT_WR)
    assert case.keeper.run() == 0
    assert sent[:-1] == [signal.SIGTERM] * told
    assert signal.getsignal(signal.SIGTERM) == case.keeper.end


def test_neutral_is_told_once_and_tried_again(watch: Any) -> None:
    case = watch("pass")
    case.board.failures = 2
    case.keeper.end_pulses()
    assert since_ms(case.board)[0] == (20.0, "pulses")
    assert read_reply(case.source.recv(4096)) is not None
    case.source.setblocking(False)
    with pytest.raises(BlockingIOError):
        case.source.recv(4096)


def test_nobody_to_tell_is_no_reason_to_stop(watch: Any) -> None:
    case = watch("pass")
    case.source.close()
    case.keeper.end_pulses()
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


def test_a_service_manager_that_reads_nothing_keeps_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def tell() -> None:
        for _ in range(2000):
            notify({"WATCHDOG": "1"})

    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        told = Thread(target=tell, daemon=True)
        told.start()
        told.join(30.0)
        assert not told.is_alive()


def test_the_outputs_of_a_board_can_be_switched_off_from_a_shell(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    smbus2 = pytest.importorskip("smbus2")
    opened = []

    def open_bus(number: object) -> FakeSmbus:
        opened.append((number, FakeSmbus({0x41: Pca9685Fake()})))
        opened[-1][1].failures = stutters.pop() if stutters else 0
        return opened[-1][1]

    stutters, naps = [0], list[float]()

    monkeypatch.setattr(smbus2, "SMBus", open_bus)
    assert switch_off(["off", "3", "41"], naps.append) == 0, "hexadecimal, as i2cdetect has it"
    assert (opened[0][0], opened[0][1].log) == (3, [(0x41, 0xFD, (0x10,))])
    assert switch_off(["off", "/dev/i2c-3", "0x41"], naps.append) == 0
    stutters = [1, 1]
    assert switch_off(["off", "3", "0x41"], naps.append) == 0
    assert [number for number, _ in opened] == [3, "/dev/i2c-3", 3, 3, 3]
    assert sum(naps) == pytest.approx(0.2)
    assert switch_off(["off"], naps.append) == 1
    assert "PCA9685 at 0x40 on /dev/i2c-1: no answer" in capfd.readouterr().err
    assert sum(naps) == pytest.approx(5.1)


def test_another_device_at_the_address_is_not_taken_for_a_board_that_is_off(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    class Deaf(Pca9685Fake):
        def read(self, register: int, length: int) -> list[int]:
            return [0] * length

    smbus2 = pytest.importorskip("smbus2")
    monkeypatch.setattr(smbus2, "SMBus", lambda _: FakeSmbus({0x40: Deaf()}))
    assert switch_off(["off"], lambda _: None) == 1
    assert "do not read back as off: another device?" in capfd.readouterr().err


@pytest.mark.parametrize("address", ["08", "77"])
def test_the_first_and_the_last_address_of_a_bus_are_addresses(monkeypatch: pytest.MonkeyPatch, address: str) -> None:
    smbus2 = pytest.importorskip("smbus2")
    monkeypatch.setattr(smbus2, "SMBus", lambda _: FakeSmbus({int(address, 16): Pca9685Fake()}))
    assert switch_off(["off", "1", address], lambda _: None) == 0


@pytest.mark.parametrize(
    "arguments", [[], ["of"], ["off", "1", "zz"], ["off", "1", "7"], ["off", "1", "80"], ["off", "1", "40", "3"]]
)
def test_what_a_person_mistypes_opens_no_bus(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        switch_off(arguments)
    assert ended.value.code == 2
    assert "usage: python -m tral_env.hardware.actuator" in capsys.readouterr().err


def test_a_board_that_cannot_be_opened_is_told_to_the_source(tmp_path: Any) -> None:
    source, commands = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with source:
        given = settings()
        given = type(given)(**{**vars(given), "bus": str(tmp_path / "missing" / "log")})
        assert main([str(commands.detach()), given.to_json()]) == 1
        assert b"No such file" in source.recv(4096)


@pytest.fixture(autouse=True)
def unnamed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names that a process took; the tests keep theirs, and their rights."""
    names: list[str] = []
    monkeypatch.setattr(keeper.rights, "name", names.append)
    monkeypatch.setattr(keeper.rights, "claim", dict)
    return names


def test_signals_that_were_ignored_or_blocked_before_the_start_are_not_afterwards() -> None:
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGCHLD})
    try:
        own_signals()
        assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == set()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
    assert {signal.getsignal(each) for each in (signal.SIGCHLD, signal.SIGTERM)} == {signal.SIG_DFL}
    assert {signal.getsignal(each) for each in (signal.SIGHUP, signal.SIGINT, signal.SIGPIPE)} == {signal.SIG_IGN}


def begun(given: Settings, *folders: str) -> tuple[int, bytes]:
    """Exit status and first words of a start in this process."""
    source, commands = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with source:
        status = main([str(commands.detach()), given.to_json(), *folders])
        return status, source.recv(4096)


@pytest.fixture
def chip(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> tuple[Pca9685Fake, Settings]:
    """A board, and settings that name its bus."""
    smbus2 = pytest.importorskip("smbus2")
    board = Pca9685Fake()
    monkeypatch.setattr(smbus2, "SMBus", lambda _: FakeSmbus({0x40: board}))
    (tmp_path / "i2c-1").touch()
    return board, replace(settings(), driver="pca9685", bus=str(tmp_path / "i2c-1"))


def test_a_start_takes_no_signal_as_the_policy_left_it_and_never_waits_for_the_socket(
    chip: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fork(given: Settings, driver: Any, commands: socket.socket, *_: Any) -> int:
        timeouts.append(commands.gettimeout())
        return 5

    timeouts: list[float | None] = []
    monkeypatch.setattr(keeper.rights, "in_container", lambda: False)
    monkeypatch.setattr(keeper, "_fork", fork)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    source, commands = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with source:
        assert main([str(commands.detach()), chip[1].to_json()]) == 5
    assert timeouts == [0.0]
    assert signal.getsignal(signal.SIGCHLD) == signal.SIG_DFL


def test_a_bus_by_number_is_its_device_file() -> None:
    given = replace(settings(), bus=250, options={"bus": "/dev/null"})
    status, told = begun(given)
    assert status == 1
    assert "'/dev/i2c-250'" in json.loads(told)["error"]


def test_a_container_is_refused_before_anything_is_sent(chip: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keeper.rights, "in_container", lambda: True)
    status, told = begun(chip[1])
    assert (status, json.loads(told)["kind"], chip[0].seen) == (1, "ConfigError", [])
    assert b"in_container=True" in told


def test_a_library_that_is_missing_is_told_with_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "serial", None)
    given = replace(settings(), driver="board2016", bus="/dev/null", options={"port": "/dev/null"})
    status, told = begun(given)
    assert status == 1
    assert json.loads(told)["missing"] == ["pyserial", "car", "the serial board of the car"]


def test_a_folder_of_devices_has_one_owner(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keeper, "_CLAIM_S", 0.0)
    given = replace(settings(), bus=str(tmp_path), options={"bus": str(tmp_path / "log")})
    owner = os.open(tmp_path, os.O_RDONLY | os.O_DIRECTORY)
    fcntl.flock(owner, fcntl.LOCK_EX)
    status, told = begun(given)
    os.close(owner)
    assert (status, json.loads(told)["kind"]) == (1, "HardwareError")
    assert f"another process drives the board at 0x40 on {tmp_path}".encode() in told


@pytest.mark.parametrize("meant", [True, False])
def test_parent_and_child_of_the_fork_are_keeper_and_worker(
    chip: Any, monkeypatch: pytest.MonkeyPatch, unnamed: list[str], meant: bool
) -> None:
    done: list[str] = []
    monkeypatch.setattr(keeper.rights, "in_container", lambda: meant)
    monkeypatch.setattr(keeper.rights, "claim", lambda: done.append("claim") or {"realtime": True})
    monkeypatch.setattr(keeper.gc, "freeze", lambda: done.append("freeze"))
    given = replace(chip[1], in_container=meant)
    child = subprocess.Popen([sys.executable, "-S", "-c", "import time; time.sleep(60)"])
    before = list(sys.path)
    monkeypatch.setattr(keeper.os, "fork", lambda: child.pid)
    status, told = begun(given, "/somewhere")
    assert (status, told[:4], sys.path[-1]) == (0, b"TRAL", "/somewhere")
    assert chip[0].seen[-1] == OFF
    assert done == ["claim", "freeze"]
    sys.path[:] = before
    child.wait()

    class Ended(BaseException):
        pass

    def end(status: int) -> None:
        statuses.append(status)
        raise Ended

    statuses: list[int] = []
    monkeypatch.setattr(keeper.os, "fork", lambda: 0)
    monkeypatch.setattr(keeper.os, "_exit", end)
    source, commands = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    number = commands.detach()
    source.shutdown(socket.SHUT_WR)
    with pytest.raises(Ended):
        main([str(number), given.to_json()])
    assert statuses == [0, 1], "the worker's own, and that of whatever comes behind it"
    hello = json.loads(source.recv(4096))
    assert hello == {"worker": os.getpid(), "keeper": os.getppid(), "realtime": True}
    source.close()
    assert unnamed == ["tral-keeper", "tral-keeper", "tral-worker"]
    assert done == ["claim", "freeze"] * 2 + ["claim"]


@pytest.fixture
def forked(chip: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A start whose fork is none: the test is parent (1) or child (0), and gives what worker or keeper then does."""

    def start(pid: int, role: str, run: Any) -> int:
        class Role:
            def __init__(self, *arguments: Any, **named: Any) -> None:
                self.arguments, self.named = arguments, named

            def run(self) -> int:
                run(*self.arguments, **self.named)
                return 0

        monkeypatch.setattr(keeper.rights, "in_container", lambda: False)
        monkeypatch.setattr(keeper.gc, "freeze", lambda: None)
        monkeypatch.setattr(keeper.os, "fork", lambda: pid)
        monkeypatch.setattr(keeper, role, Role)
        return begun(chip[1])[0]

    return start


def test_the_keeper_holds_no_end_of_the_worker(forked: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(given: Settings, driver: Any, commands: socket.socket, worker: socket.socket, pid: int, shown: Any) -> None:
        assert (worker.gettimeout(), pid, shown) == (0.0, 1, None)
        assert worker.recv(8) == b"", "the other end is the worker's alone"
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(policies[0])

    real, policies = os.pidfd_open, []

    def open_policy(pid: int) -> int:
        policies.append(real(pid))
        return policies[-1]

    monkeypatch.setattr(keeper.os, "pidfd_open", open_policy)
    assert forked(1, "Keeper", run) == 0


def test_the_worker_holds_no_end_of_the_keeper_and_knows_its_policy(
    forked: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(given: Settings, driver: Any, commands: Any, kept: socket.socket, policy: int, shown: Any) -> None:
        assert (kept.gettimeout(), shown) == (0.0, None)
        assert kept.recv(8) == b"", "the other end is the keeper's alone"
        os.fstat(policy)
        ended.append(-1)

    ended: list[int] = []
    monkeypatch.setattr(keeper.os, "_exit", ended.append)
    with suppress(UnboundLocalError, TypeError, OSError):
        forked(0, "Worker", run)
    assert ended[:3] == [-1, 0, 1]


def test_a_worker_that_fails_says_why(
    forked: Any, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    class Ended(BaseException):
        pass

    def end(status: int) -> None:
        statuses.append(status)
        raise Ended

    def run(*_: Any, **__: Any) -> None:
        raise RuntimeError("the worker has a flaw")

    statuses: list[int] = []
    monkeypatch.setattr(keeper.os, "_exit", end)
    with pytest.raises(Ended):
        forked(0, "Worker", run)
    assert statuses == [1]
    assert "RuntimeError: the worker has a flaw" in capfd.readouterr().err


def test_a_link_does_not_hide_the_owner_of_a_board(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keeper, "_CLAIM_S", 0.02)
    (tmp_path / "bus").touch()
    (tmp_path / "link").symlink_to(tmp_path / "bus")
    lock = struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, 0x40, 1, 0)
    with (tmp_path / "bus").open("r+b") as owner:
        fcntl.fcntl(owner, fcntl.F_OFD_SETLK, lock)
        status, told = begun(replace(settings(), bus=str(tmp_path / "link")))
    assert status == 1
    assert b"another process drives the board at 0x40" in told
    assert (tmp_path / "bus").read_text() == ""


@pytest.fixture
def owned(tmp_path: Path) -> Iterator[Any]:
    """The file of a bus on which another process drives the board 0x40."""
    (tmp_path / "bus").touch()
    with (tmp_path / "bus").open("r+b") as owner:
        fcntl.fcntl(owner, fcntl.F_OFD_SETLK, struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, 0x40, 1, 0))
        yield owner


@pytest.mark.parametrize("address", [0x3F, 0x41])
def test_another_board_on_the_same_bus_has_an_owner_of_its_own(
    owned: Any, monkeypatch: pytest.MonkeyPatch, address: int
) -> None:
    monkeypatch.setattr(keeper, "_CLAIM_S", 0.02)
    monkeypatch.setattr(keeper, "_fork", lambda *_: 5)
    assert main_of(replace(settings(), bus=owned.name, address=address)) == 5


def test_a_board_whose_owner_is_about_to_end_is_waited_for(owned: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def sleep(seconds: float) -> None:
        naps.append(seconds)
        if len(naps) == 3:
            owned.close()

    naps: list[float] = []
    monkeypatch.setattr(keeper.time, "sleep", sleep)
    monkeypatch.setattr(keeper, "_fork", lambda *_: 5)
    assert main_of(replace(settings(), bus=owned.name)) == 5
    assert len(naps) == 3


def main_of(given: Settings) -> int:
    """Exit status of a start in this process; nobody listens."""
    source, commands = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with source:
        return main([str(commands.detach()), given.to_json()])


class Hurry(Clock):
    """A clock that jumps at each look."""

    def __init__(self, ms: float) -> None:
        super().__init__()
        self.ms = ms

    def __call__(self) -> int:
        self.now_ns += round(self.ms * MS)
        return self.now_ns


@pytest.mark.parametrize("failures", [0, 100])
def test_a_worker_ends_when_its_source_did_and_the_board_took_the_end(failures: int) -> None:
    car = Works()
    car.source.close()
    car.board.failures = failures
    worker = Worker(settings(), car.board, *car.ends, clock_ns=Hurry(500.0 if failures else 30.0))
    assert worker.run() == 0
    assert worker.guard.reason is Reason.LOST
    assert signal.getsignal(signal.SIGTERM) == worker.end
    assert car.board.stands == OFF
    assert car.clock.now_ns == Clock().now_ns, "the worker waits on its own clock"
    car.close()


def test_the_end_of_the_policy_is_the_end_even_if_its_socket_is_held_open() -> None:
    car = Works()
    read_end, write_end = os.pipe()
    os.close(write_end)
    worker = Worker(settings(), car.board, *car.ends, clock_ns=Hurry(30.0), policy=read_end)
    assert worker.run() == 0
    assert worker.guard.reason is Reason.LOST
    assert car.board.stands == OFF
    words = [car.source.recv(4096)]
    while words[-1] != ENDED:
        words.append(car.source.recv(4096))
    os.close(read_end)
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
