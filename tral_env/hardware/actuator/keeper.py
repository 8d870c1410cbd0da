"""The keeper: the worker's parent. It opens the board, starts the worker, and does one thing if that dies or hangs.

It touches the board only before the worker begins and after the worker was killed, so the board has one owner at any
time. It is opened before the fork: an emergency is no time to open files, import, or ask for memory. It tries for ever,
unless the board is a stand-in whose program has ended.
"""

from __future__ import annotations

import argparse
import fcntl
import gc
import json
import os
import select
import signal
import socket
import struct
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import NoReturn

from tral_env.errors import ConfigError, HardwareError, MissingExtraError, TralError
from tral_env.hardware.actuator import rights
from tral_env.hardware.actuator.drivers import Driver, open_driver
from tral_env.hardware.actuator.pca9685 import all_off, still_on
from tral_env.hardware.actuator.settings import MAX_ADDRESS, MIN_ADDRESS, Settings
from tral_env.hardware.actuator.stand_in import GIVEN_UP, StandIn, stand_in
from tral_env.hardware.actuator.wire import ENDED, MAX_PACKET, NS, Reason, Refusal, Reply, State, pack_reply
from tral_env.hardware.actuator.worker import ALIVE, Worker
from tral_env.hardware.i2c import Bus

_TRY_S = 0.01
"""In an emergency the keeper writes this often."""
_HURRY_S = 30.0
"""After this time of an emergency it tries less often, though it never gives up: a plug may touch again."""
_LATER_S = 0.1
"""Time between two tries then."""
_COMPLAIN_S = 1.0
"""After so long without success it says so, once."""
_WATCHDOG_S = 0.1
"""The service manager hears this often that all is well."""
_CLAIM_S = 2.0
"""A process that drives the board and is about to end is given so long."""
_OFF_TRIES, _OFF_WAIT_S = 50, 0.1
"""From a shell, the pulses are ended by so many tries, s apart."""
_DEATH_S = 0.02
"""The keeper waits this long for a killed worker to be gone: one that hangs in a transaction dies at its end."""


_STDERR = 2


def main(arguments: list[str]) -> int:
    """Run keeper and worker.

    Args:
        arguments: number of the socket's file descriptor, `Settings` as JSON, then folders to import from, if any.

    Returns:
        Exit status 0: the pulses have ended; 1: it could not begin; `GIVEN_UP`: the program behind a stand-in is gone.
    """
    own_signals()
    rights.name("tral-keeper")
    sys.path += arguments[2:]
    settings = Settings.from_json(arguments[1])
    with socket.socket(fileno=int(arguments[0])) as commands:
        commands.setblocking(False)
        try:
            policy = _policy(commands)
            driver = open_driver(settings)
            with _claimed(settings):
                _check_container(settings)
                shown = stand_in(_device_file(settings))
                driver.start()
                return _fork(settings, driver, commands, policy, shown)
        except (TralError, OSError) as error:
            told: dict[str, object] = {"error": str(error), "kind": type(error).__name__}
            if isinstance(error, MissingExtraError):
                told["missing"] = error.missing
            with suppress(OSError):
                commands.send(json.dumps(told).encode()[:MAX_PACKET])
            return 1


def own_signals() -> None:
    """Take no signal as the program before this one left it: an exec keeps what was ignored and what was blocked.

    SIGPIPE stays ignored, so that a reader that is gone is an error and no end.
    """
    for default in (signal.SIGCHLD, signal.SIGTERM, signal.SIGQUIT, signal.SIGUSR1, signal.SIGUSR2, signal.SIGALRM):
        signal.signal(default, signal.SIG_DFL)
    terminal = (signal.SIGINT, signal.SIGHUP, signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)
    for ignored in (*terminal, signal.SIGPIPE, signal.SIGXFSZ):
        signal.signal(ignored, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())


def _device_file(settings: Settings) -> str:
    """Path of the board's device file."""
    return f"/dev/i2c-{settings.bus}" if isinstance(settings.bus, int) else settings.bus


@contextmanager
def _claimed(settings: Settings) -> Iterator[None]:
    """Make sure that no other process of this kind drives the board: a lock, free when keeper and worker are gone.

    It is a lock on the byte of the bus's device file whose number is the board's address. So two boards on one bus
    have an owner each, and neither a link to the file nor a network namespace hides it.

    Raises:
        HardwareError: another one drives it, and does not end.
    """
    bus = _device_file(settings)
    lock = struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, settings.address, 1, 0)
    how = os.O_RDONLY | os.O_DIRECTORY if os.path.isdir(bus) else os.O_RDWR | os.O_NONBLOCK | os.O_NOCTTY  # noqa: PTH112
    file, until_s = os.open(bus, how | os.O_CLOEXEC), time.monotonic() + _CLAIM_S
    try:
        while not _locks(file, lock if how & os.O_RDWR else None):
            if time.monotonic() > until_s:
                raise HardwareError(
                    f"another process drives the board at 0x{settings.address:02x} on {bus}: end it first. Its name is "
                    "tral-worker; if it only waits for a board that does not answer, cut the power of the motor and "
                    "run `killall -9 tral-keeper tral-worker`"
                )
            time.sleep(_TRY_S)
        yield
    finally:
        with suppress(OSError):  # a file of a mount that is dead
            os.close(file)


def _locks(file: int, lock: bytes | None) -> bool:
    """Whether an open file can be locked, or an open folder as a whole (None); a fork has the lock too."""
    try:
        if lock is None:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        else:
            fcntl.fcntl(file, fcntl.F_OFD_SETLK, lock)
    except (BlockingIOError, PermissionError):
        return False
    return True


def _check_container(settings: Settings) -> None:
    """Refuse to drive a board where the end of another process is the end of this one.

    Raises:
        ConfigError: this is a container, and the settings do not say that this is meant.
    """
    if settings.driver != "log" and not settings.in_container and rights.in_container():
        raise ConfigError(
            "the car's program runs in a container (a PID namespace): when its first process ends, the kernel kills "
            "the actuator's process too, and the last pulses stand. Run it outside. If the pin OE of the board ends "
            "the pulses then, give output=ActuatorProcess(replace(actuator_settings(...), in_container=True))"
        )


def _fork(settings: Settings, driver: Driver, commands: socket.socket, policy: int, shown: StandIn | None) -> int:
    """Split into worker and keeper."""
    rights.claim()
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        for each in (ours, theirs):
            each.setblocking(False)
        gc.freeze()
        worker = os.fork()
        if worker == 0:
            ours.close()
            _work(commands, lambda: Worker(settings, driver, commands, theirs, policy=policy, shown=shown))
        theirs.close()
        os.close(policy)
        return Keeper(settings, driver, commands, ours, worker, shown=shown).run()


def _work(commands: socket.socket, make_worker: Callable[[], Worker]) -> NoReturn:
    """Be the worker, to the end of this process."""
    try:
        rights.name("tral-worker")
        hello = {"worker": os.getpid(), "keeper": os.getppid(), **rights.claim()}
        with suppress(OSError):  # a policy that is gone is noticed soon enough
            commands.send(json.dumps(hello).encode())
        os._exit(make_worker().run())
    except BaseException:
        _complain(traceback.format_exc())
    finally:
        os._exit(1)


def _policy(commands: socket.socket) -> int:
    """File descriptor of the process that made the socket; it becomes readable when that process ends.

    Raises:
        OSError: it has ended already.
    """
    pid, _, _ = struct.unpack("3i", commands.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))
    return os.pidfd_open(pid)


class Keeper:
    """Watches one worker."""

    def __init__(
        self,
        settings: Settings,
        driver: Driver,
        commands: socket.socket,
        worker: socket.socket,
        pid: int,
        clock_ns: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
        shown: StandIn | None = None,
    ) -> None:
        """Watch a child that shows its life on a socket.

        Args:
            settings: what to keep to.
            driver: the board.
            commands: where the policy's process sends commands.
            worker: where the worker shows its life.
            pid: of the worker.
            clock_ns: monotonic clock, ns.
            sleep: waits some seconds.
            shown: the stand-in that the board is; None: a board of its own, which is never given up.
        """
        self._settings, self._driver, self._commands = settings, driver, commands
        self._worker, self._clock_ns, self._sleep, self._shown = worker, clock_ns, sleep, shown
        self._pid, self._process = pid, os.pidfd_open(pid)
        self._told_to_end = False

    def run(self) -> int:
        """Watch until the worker ends; if it does not end by itself with a status that is final, end the pulses.

        Returns:
            Exit status 0: the pulses have ended; `GIVEN_UP`: the program behind a stand-in is gone.
        """
        trouble = "the worker died or stood still"
        try:
            signal.signal(signal.SIGTERM, self.end)
            status = self._status() if self._watch() else None
            if status == 0:
                notify({"WATCHDOG_USEC": "0"})
                return 0
            if status == GIVEN_UP and self._shown is not None:
                return self._give_up()
        except BaseException:  # whatever it is, the pulses have to end
            trouble = traceback.format_exc()
        self._kill()
        if not self.end_pulses():
            return self._give_up()
        with suppress(OSError):
            self._commands.send(ENDED)
        notify({"WATCHDOG_USEC": "0"})
        _complain(f"{trouble}; the keeper has ended the pulses")
        return 0

    def end(self, *_: object) -> None:
        """Let the worker stop the car, at its next sign of life: a signal handler."""
        self._told_to_end = True

    def end_pulses(self) -> bool:
        """Write neutral until it has stood, then off; again and again while the board refuses, for ever if need be.

        Returns:
            Whether the pulses have ended; False: the board was a stand-in, and the program behind it is gone.
        """
        limits, begun_ns = self._settings.limits, self._clock_ns()
        neutral_us = self._settings.steering.centre_us, self._settings.throttle.centre_us
        told = complained = False
        while True:
            past_s = (self._clock_ns() - begun_ns) / NS
            with suppress(Exception):  # a driver that fails in its own way is a board that refuses
                if past_s >= limits.off_s - limits.silence_s:
                    self._driver.off()
                    return True
                self._driver.set_pulses(*neutral_us)
                told = told or self._tell(neutral_us)
            if past_s > _COMPLAIN_S and not complained:
                complained = True
                _complain("THE PULSES COULD NOT BE ENDED YET: cut the power of the motor. The keeper goes on trying")
            if self._shown is not None and self._shown.is_given_up(self._clock_ns()):
                return False
            self._sleep(_TRY_S if past_s < _HURRY_S else _LATER_S)

    def _give_up(self) -> int:
        """Leave a stand-in whose program is gone.

        Returns:
            Exit status.
        """
        notify({"WATCHDOG_USEC": "0"})
        _complain(
            f"the pulses were not ended: {_device_file(self._settings)} is no board but a stand-in, such as the "
            "twin's, and the program that showed it is gone. Nothing drives"
        )
        return GIVEN_UP

    def _watch(self) -> bool:
        """Return when the worker has closed its socket (True), or has shown no life for too long (False)."""
        poll, fed_ns = select.poll(), 0
        poll.register(self._worker, select.POLLIN)
        watchdog = os.environ.get("WATCHDOG_USEC")
        notify({"READY": "1"} | ({"WATCHDOG_USEC": watchdog} if watchdog else {}))
        while poll.poll(self._settings.limits.hang_s * 1000):
            try:
                if not self._worker.recv(MAX_PACKET):
                    return True
                self._worker.send(ALIVE)
                if self._told_to_end:
                    self._signal(signal.SIGTERM)
            except BlockingIOError:
                continue
            except OSError:
                return True
            if (now_ns := self._clock_ns()) - fed_ns > _WATCHDOG_S * NS:
                fed_ns = now_ns
                notify({"WATCHDOG": "1"})
        return False

    def _kill(self) -> None:
        """Make sure that the worker writes no more; nothing that fails here keeps the pulses from being ended."""
        with suppress(Exception):
            self._signal(signal.SIGKILL)
            self._status()

    def _signal(self, number: signal.Signals) -> None:
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._process, number)

    def _status(self) -> int | None:
        """Exit status of the worker, or None if it is not known or the worker does not die within `_DEATH_S`."""
        poll = select.poll()
        poll.register(self._process, select.POLLIN)
        if not poll.poll(_DEATH_S * 1000):
            return None
        try:
            return os.waitstatus_to_exitcode(os.waitpid(self._pid, 0)[1])
        except ChildProcessError:  # somebody else took it
            return None

    def _tell(self, neutral_us: tuple[float, float]) -> bool:
        """Tell the source of the commands."""
        reply = Reply(
            State.LATCHED, Reason.WORKER, Refusal.NONE, 0, self._clock_ns(), 0.0, 0.0, *neutral_us, 0, 0, 0, 0
        )
        with suppress(OSError):
            self._commands.send(pack_reply(reply))
        return True


def notify(states: dict[str, str]) -> None:
    """Tell systemd, if it asks for that; see sd_notify(3). ``WATCHDOG_USEC=0`` ends its watch."""
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.setblocking(False)
        try:
            manager.connect("\0" + address[1:] if address[0] == "@" else address)
            manager.send("\n".join(f"{name}={value}" for name, value in states.items()).encode())
        except OSError:
            return


def _complain(text: str) -> None:
    """Say what happened, unless that would take time: a terminal that is gone or blocks must not keep anyone."""
    poll = select.poll()
    poll.register(_STDERR, select.POLLOUT)
    with suppress(OSError):
        if poll.poll(0):
            os.write(_STDERR, f"actuator: {text}\n".encode()[-select.PIPE_BUF :])


def switch_off(arguments: list[str], sleep: Callable[[float], None] = time.sleep) -> int:
    """End all pulses of a PCA9685, from whatever program they are, and read back that they ended.

    Args:
        arguments: "off", then the number or path of the I2C bus, and the address of the board.
        sleep: waits some seconds.

    Returns:
        Exit status: 0 if no pulses leave the board.
    """
    parser = argparse.ArgumentParser(
        "python -m tral_env.hardware.actuator", description="End all pulses of a PWM board PCA9685, whoever left them."
    )
    parser.add_argument("off", choices=["off"], help="end the pulses")
    parser.add_argument("bus", nargs="?", default="1", help="number or path of the I2C bus; 1 is /dev/i2c-1")
    parser.add_argument(
        "address", nargs="?", type=_address, default="40", help="address of the board, hexadecimal as i2cdetect has it"
    )
    given = parser.parse_args(arguments)
    bus = int(given.bus) if given.bus.isdecimal() else given.bus
    for attempt in range(_OFF_TRIES):
        sleep(_OFF_WAIT_S if attempt else 0.0)
        try:
            device = Bus(bus).device(given.address, "PWM board PCA9685")
            all_off(device)
            if not (outputs := still_on(device)):
                return 0
            trouble = f"the outputs {outputs} do not read back as off: another device?"
        except (TralError, OSError) as error:
            trouble = str(error)
    _complain(f"the pulses could not be ended: cut the power of the motor. {trouble}")
    return 1


def _address(text: str) -> int:
    """Address of the board, always hexadecimal.

    Raises:
        ArgumentTypeError: no address.
    """
    try:
        address = int(text, 16)
    except ValueError:
        address = -1
    if not MIN_ADDRESS <= address <= MAX_ADDRESS:
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected a hexadecimal address, {MIN_ADDRESS:02x} to {MAX_ADDRESS:02x}"
        )
    return address
