"""The policy's end of the socket, against a worker in a thread whose board fails on demand."""

import contextlib
import json
import os
import select
import socket
import subprocess
import threading
import time
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any, ClassVar

import pytest
from rig import NEUTRAL, OFF, Clock, FakeBoard, settings

from tral_env.errors import HardwareError, MissingExtraError
from tral_env.hardware.actuator import client
from tral_env.hardware.actuator.client import ActuatorProcess
from tral_env.hardware.actuator.stand_in import GIVEN_UP
from tral_env.hardware.actuator.wire import ENDED, Reason, Refusal, Reply, State, pack_reply
from tral_env.hardware.actuator.worker import Worker


class Real(Clock):
    """The computer's clock."""

    def __call__(self) -> int:
        self.now_ns = time.monotonic_ns()
        return self.now_ns


class Thread:
    """Stands for the process: a worker in a thread, and a keeper that answers."""

    board: FakeBoard
    worker: Worker
    says: dict[str, Any]
    arguments: list[str]
    works = True
    lingers = False
    status = 0

    def __init__(self, arguments: list[str], pass_fds: list[int], **_: Any) -> None:
        type(self).arguments = arguments
        self.commands = socket.socket(fileno=socket.dup(pass_fds[0]))
        self.commands.send(json.dumps(self.says).encode())
        self.commands.setblocking(False)
        self.keeper, kept = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        for each in (self.keeper, kept):
            each.setblocking(False)
        self.kept, self.over = kept, False
        type(self).board = FakeBoard(Real())
        self.board.start()
        type(self).worker = Worker(settings(hang_s=0.5), self.board, self.commands, kept)
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self) -> None:
        sources = [self.commands]
        while not self.over and not self.worker.guard.is_over:
            if self.works:
                self.keeper.send(b".")
                heard, _, _ = select.select(sources, [], [], 0.002)
                for lost in self.worker.turn(bool(heard), True):
                    sources.remove(lost)
        if self.status == 0:
            self.worker.say_ended()
        for each in (self.commands, self.keeper, self.kept):
            each.close()

    def wait(self, timeout: float = 0.0) -> int:
        self.over = True
        self.thread.join()
        if self.lingers:
            raise subprocess.TimeoutExpired("actuator", timeout)
        return self.status

    def poll(self) -> int | None:
        return None if self.thread.is_alive() else self.status


@pytest.fixture
def process(monkeypatch: pytest.MonkeyPatch) -> type[Thread]:
    class Fresh(Thread):
        says: dict[str, Any] = {"worker": 1, "keeper": 2}  # noqa: RUF012

    monkeypatch.setattr(client.subprocess, "Popen", Fresh)
    return Fresh


def drive(actuator: ActuatorProcess, seconds: float) -> None:
    for _ in range(round(seconds * 80)):
        actuator.command(0.0, 0.5, 0)
        time.sleep(0.0125)
        actuator.check()


def test_a_board_that_refused_is_told_and_can_be_armed_again(process: type[Thread]) -> None:
    with ActuatorProcess(settings()) as actuator:
        actuator.arm()
        drive(actuator, 0.1)
        process.board.failures = 10**9
        with pytest.raises(HardwareError, match="did not take pulses"):
            drive(actuator, 1.0)
        process.board.failures = 0
        actuator.neutral()
        assert actuator.reply is not None
        assert actuator.reply.reason is Reason.BUS
        actuator.arm()
        drive(actuator, 0.1)


def test_transactions_that_were_tried_again_are_counted(process: type[Thread]) -> None:
    with ActuatorProcess(settings()) as actuator:
        assert actuator.retries == 0
        actuator.arm()
        process.board.failures = 2
        actuator.command(0.0, 0.5, 1)
        until_s = time.monotonic() + 30.0
        while actuator.retries < 2 and time.monotonic() < until_s:
            actuator.command(0.0, 0.5, 1)
            time.sleep(0.005)
            actuator.check()
        assert actuator.retries == 2


def test_a_board_that_goes_on_refusing_neutral_says_to_cut_the_power(process: type[Thread]) -> None:
    with ActuatorProcess(settings()) as actuator:
        actuator.arm()
        drive(actuator, 0.1)
        process.board.failures = 10**9
        with pytest.raises(HardwareError, match="Cut the power of the motor"):
            actuator.neutral()
        process.board.failures = 0
        actuator.neutral()
        assert process.board.stands == NEUTRAL


def test_a_board_that_cannot_be_armed_is_told_with_the_reason(
    process: type[Thread], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "_ARM_S", 0.1)
    with ActuatorProcess(settings()) as actuator:
        actuator.arm()
        process.board.lost = "MODE1 0x11"
        with pytest.raises(HardwareError, match="lost its settings"):
            drive(actuator, 1.0)
        process.board.failures = 10**9
        with pytest.raises(HardwareError, match="does not arm: the PWM board lost its settings"):
            actuator.arm()
        process.board.failures = 0
        actuator.arm()


def test_a_worker_that_does_not_answer_is_told(process: type[Thread]) -> None:
    with ActuatorProcess(settings()) as actuator:
        with pytest.raises(HardwareError, match="does not answer"):
            actuator.check()
        actuator.neutral()
        with pytest.raises(HardwareError, match="is not armed"):
            actuator.check()
        actuator.arm()
        process.works = False
        with pytest.raises(HardwareError, match="does not answer"):
            drive(actuator, 2.0)
        with pytest.raises(HardwareError, match="does not answer"):
            actuator.neutral()
        process.works = True


def test_pulses_that_could_not_be_ended_are_told_at_the_close(process: type[Thread]) -> None:
    actuator = ActuatorProcess(settings())
    process.status = 1
    for _ in range(2):
        with pytest.raises(HardwareError, match="could not end the pulses"):
            actuator.close()


def test_a_process_that_goes_on_trying_is_told_and_waited_for_again(
    process: type[Thread], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "_END_S", 0.1)
    actuator = ActuatorProcess(settings())
    process.board.failures = 10**9
    with pytest.raises(HardwareError, match=r"could not end the pulses yet\. Cut the power"):
        actuator.close()
    process.board.failures = 0
    monkeypatch.setattr(client, "_END_S", 3.0)
    actuator.close()


def test_a_process_that_ended_the_pulses_and_lingers_is_no_alarm(process: type[Thread]) -> None:
    actuator = ActuatorProcess(settings())
    process.lingers = True
    actuator.close()
    assert process.board.stands == OFF


def test_a_process_that_gave_a_stand_in_up_is_no_alarm_once_it_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client.subprocess, "Popen", Mute)
    monkeypatch.setattr(client, "_END_S", 0.05)
    monkeypatch.setattr(Mute, "packets", (b"{}",))
    actuator = ActuatorProcess(settings())
    with pytest.raises(HardwareError, match="could not end the pulses yet"):
        actuator.close()
    for status in (0, 1):
        monkeypatch.setattr(Mute, "ended", status)
        with pytest.raises(HardwareError, match="could not end the pulses yet"):
            actuator.close()
    monkeypatch.setattr(Mute, "ended", GIVEN_UP)
    actuator.close()


def test_a_copy_of_the_socket_in_a_fork_does_not_keep_the_process(process: type[Thread]) -> None:
    actuator = ActuatorProcess(settings())
    copies = [os.dup(fd) for fd in sockets()]
    actuator.close()  # it would tell that the pulses could not be ended
    assert process.board.stands == OFF
    for each in copies:
        os.close(each)


def sockets() -> list[int]:
    """File descriptors of this process that are sockets."""
    found = []
    for entry in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):
            if str(entry.readlink()).startswith("socket:"):
                found.append(int(entry.name))
    return found


def test_a_fork_neither_drives_nor_closes(process: type[Thread], monkeypatch: pytest.MonkeyPatch) -> None:
    actuator = ActuatorProcess(settings())
    actuator.arm()
    with monkeypatch.context() as fork:
        fork.setattr(client.os, "getpid", lambda: 1)
        with pytest.raises(HardwareError, match="is a fork of the one that opened the car"):
            actuator.command(0.0, 0.5, 0)
        actuator.close()
    drive(actuator, 0.1)
    actuator.close()


def test_after_an_emergency_stop_only_an_explicit_arm_drives_on(process: type[Thread]) -> None:
    with ActuatorProcess(settings()) as actuator:
        assert actuator.arm() == ""
        actuator.resume()
        drive(actuator, 0.1)
        assert actuator.pulses_us == (1530.0, 1300.0)
        actuator.stop()
        with pytest.raises(HardwareError, match=r"a stop was commanded\. Only a reset arms it again"):
            actuator.resume()
        assert actuator.arm() == "a stop was commanded"
        drive(actuator, 0.1)


def test_a_silence_is_resumed(process: type[Thread]) -> None:
    with ActuatorProcess(settings()) as actuator:
        actuator.arm()
        time.sleep(0.6)
        actuator.resume()
        drive(actuator, 0.1)
        assert actuator.reply is not None
        assert actuator.reply.state is State.ARMED


@pytest.mark.parametrize("found", [None, "/user/lib/smbus2/__init__.py"])
def test_the_folder_of_the_buss_library_is_handed_over(
    process: type[Thread], monkeypatch: pytest.MonkeyPatch, found: str | None
) -> None:
    spec = None if found is None else ModuleSpec("smbus2", None, origin=found)
    monkeypatch.setattr(client.importlib.util, "find_spec", lambda _: spec)
    with ActuatorProcess(settings()):
        assert process.arguments[5:] == ([] if found is None else ["/user/lib"])


def test_a_closed_actuator_takes_no_command(process: type[Thread]) -> None:
    actuator = ActuatorProcess(settings())
    actuator.arm()
    actuator.close()
    with pytest.raises(HardwareError, match="is gone"):
        actuator.command(0.0, 0.5, 0)
    with pytest.raises(HardwareError, match="is gone"):
        actuator.check()


def test_a_missing_library_is_named_with_its_extra(process: type[Thread]) -> None:
    process.says = {"missing": ["smbus2", "car", "the I2C bus"], "error": "no smbus2"}
    with pytest.raises(MissingExtraError, match="smbus2"):
        ActuatorProcess(settings())


def test_an_error_at_the_start_is_told(process: type[Thread]) -> None:
    process.says = {"kind": "HardwareError", "error": "no answer at 0x40"}
    with pytest.raises(HardwareError, match="no answer at 0x40"):
        ActuatorProcess(settings())


class Mute:
    """A process that says some packets at its start, or nothing, and ends when told to."""

    packets: tuple[bytes, ...] = ()
    stays = True
    ended: int | None = None
    last: ClassVar[Any]

    def __init__(self, arguments: list[str], pass_fds: list[int], **_: Any) -> None:
        self.end = socket.socket(fileno=socket.dup(pass_fds[0]))
        Mute.last = self
        for packet in self.packets:
            self.end.send(packet)
        if not self.stays:
            self.end.close()

    def poll(self) -> int | None:
        return self.ended

    def wait(self, timeout: float) -> int:
        self.end.close()
        raise subprocess.TimeoutExpired("actuator", timeout)


def test_a_process_that_does_not_begin_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "_START_S", 0.02)
    monkeypatch.setattr(client.subprocess, "Popen", Mute)
    with pytest.raises(HardwareError, match=r"did not begin within 0\.02 s"):
        ActuatorProcess(settings())
    monkeypatch.setattr(Mute, "stays", False)
    with pytest.raises(HardwareError, match="ended before it began"):
        ActuatorProcess(settings())


def test_the_keepers_word_that_the_worker_died_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    died = Reply(State.LATCHED, Reason.WORKER, Refusal.NONE, 0, 0, 0.0, 0.0, *NEUTRAL, 0, 0, 0, 0)
    monkeypatch.setattr(client.subprocess, "Popen", Mute)
    monkeypatch.setattr(Mute, "packets", (b"{}", pack_reply(died), ENDED))
    actuator = ActuatorProcess(settings())
    with pytest.raises(HardwareError, match=r"is gone; its keeper ends the pulses: the worker died or stood still"):
        actuator.arm()
    actuator.close()
    with pytest.raises(HardwareError, match="is gone"):
        actuator.check()


def test_the_last_word_counts_also_if_not_every_command_was_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client.subprocess, "Popen", Mute)
    monkeypatch.setattr(Mute, "packets", (b"{}", ENDED))
    actuator = ActuatorProcess(settings())
    actuator.stop()
    Mute.last.end.close()
    actuator.close()


def test_an_end_without_a_word_is_an_alarm_and_a_loss(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client.subprocess, "Popen", Mute)
    monkeypatch.setattr(Mute, "packets", (b"{}",))
    monkeypatch.setattr(Mute, "stays", False)
    actuator = ActuatorProcess(settings())
    assert (actuator.applied, actuator.pulses_us) == ((0.0, 0.0), NEUTRAL)
    with pytest.raises(HardwareError, match=r"is gone; its keeper ends the pulses\. Open the car anew"):
        actuator.check()
    with pytest.raises(HardwareError, match="could not end the pulses yet"):
        actuator.close()


def test_an_answer_to_an_earlier_command_answers_no_later_one(monkeypatch: pytest.MonkeyPatch) -> None:
    early = Reply(State.DISARMED, Reason.NONE, Refusal.NONE, 0, 0, 0.0, 0.0, *NEUTRAL, 0, 0, 0, 0)
    monkeypatch.setattr(client.subprocess, "Popen", Mute)
    monkeypatch.setattr(client, "_ANSWER_S", 0.02)
    monkeypatch.setattr(Mute, "packets", (b"{}", pack_reply(early)))
    actuator = ActuatorProcess(settings())
    with pytest.raises(HardwareError, match="does not answer"):
        actuator.neutral()
    Mute.last.end.send(ENDED)
    actuator.close()
