"""The keeper: the worker's parent. It opens the board, starts the worker, and does one thing if that dies or hangs.

It touches the board only before the worker begins and after the worker was killed, so the board has one owner at any
time. It is opened before the fork: an emergency is no time to open files, import, or ask for memory.
"""

from __future__ import annotations

import errno
import gc
import json
import os
import select
import signal
import socket
import sys
import time
import traceback
import zlib
from collections.abc import Callable
from contextlib import suppress

from tral_env.errors import HardwareError, TralError
from tral_env.hardware.actuator import rights
from tral_env.hardware.actuator.drivers import Driver, open_driver
from tral_env.hardware.actuator.pca9685 import all_off
from tral_env.hardware.actuator.settings import Settings
from tral_env.hardware.actuator.wire import MAX_PACKET, NS, Reason, Refusal, Reply, State, pack_reply
from tral_env.hardware.actuator.worker import ALIVE, Worker
from tral_env.hardware.i2c import Bus

_TRY_S = 0.01
"""In an emergency the keeper writes this often."""
_GIVE_UP_S = 30.0
"""In an emergency the keeper tries for this long to end the pulses."""
_WATCHDOG_S = 0.1
"""The service manager hears this often that all is well."""
_CLAIM_S = 2.0
"""A process that drives the board and is about to end is given so long."""
_DEATH_S = 0.02
"""The keeper waits this long for a killed worker to be gone: one that hangs in a transaction dies at its end."""


def main(arguments: list[str]) -> int:
    """Run keeper and worker.

    Args:
        arguments: number of the socket's file descriptor, `Settings` as JSON.

    Returns:
        Exit status: 0 if the pulses have ended.
    """
    for ignored in (signal.SIGINT, signal.SIGHUP, signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU):
        signal.signal(ignored, signal.SIG_IGN)
    settings = Settings.from_json(arguments[1])
    with socket.socket(fileno=int(arguments[0])) as commands:
        commands.setblocking(False)
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as claim:
            try:
                _claim(claim, settings)
                driver = open_driver(settings)
                driver.start()
            except (TralError, OSError) as error:
                told = {"error": str(error), "kind": type(error).__name__}
                commands.send(json.dumps(told).encode()[:MAX_PACKET])
                return 1
            return _fork(settings, driver, commands)


def _claim(claim: socket.socket, settings: Settings) -> None:
    """Make sure that no other process of this kind drives the board: a name in the kernel, free when both are gone.

    Raises:
        HardwareError: another one drives it, and does not end.
    """
    bus = f"/dev/i2c-{settings.bus}" if isinstance(settings.bus, int) else os.path.realpath(settings.bus)
    until_s = time.monotonic() + _CLAIM_S
    while True:
        try:
            return claim.bind(f"\0tral-actuator {zlib.crc32(f'{bus} {settings.address}'.encode()):08x}")
        except OSError as error:
            if error.errno != errno.EADDRINUSE or time.monotonic() > until_s:
                raise HardwareError(
                    f"another process drives the board at 0x{settings.address:02x} on {bus}: end it first"
                ) from error
        time.sleep(_TRY_S)


def _fork(settings: Settings, driver: Driver, commands: socket.socket) -> int:
    """Split into worker and keeper."""
    rights.claim()
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for each in (ours, theirs):
        each.setblocking(False)
    gc.freeze()
    worker = os.fork()
    if worker == 0:
        ours.close()
        granted = rights.claim()
        hello = {"worker": os.getpid(), "keeper": os.getppid(), **granted}
        commands.send(json.dumps(hello).encode())
        try:
            os._exit(Worker(settings, driver, commands, theirs).run())
        except BaseException:
            _complain(traceback.format_exc())
        finally:
            os._exit(1)
    theirs.close()
    return Keeper(settings, driver, commands, ours, worker).run()


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
    ) -> None:
        """Watch a child that shows its life on a socket."""
        self._settings, self._driver, self._commands = settings, driver, commands
        self._worker, self._clock_ns, self._sleep = worker, clock_ns, sleep
        self._pid, self._process = pid, os.pidfd_open(pid)

    def run(self) -> int:
        """Watch until the worker ends; if it does not end by itself with status 0, end the pulses.

        Returns:
            Exit status: 0 if the pulses have ended.
        """
        signal.signal(signal.SIGTERM, self._pass_on)
        status = self._status() if self._watch() else None
        if status == 0:
            notify({"WATCHDOG_USEC": "0"})
            return 0
        if status is None:
            self._signal(signal.SIGKILL)
            self._status()
        if self.end_pulses():
            notify({"WATCHDOG_USEC": "0"})
            _complain("the worker died or stood still; the keeper has ended the pulses")
            return 0
        _complain("the worker died or stood still, and THE PULSES COULD NOT BE ENDED: cut the power of the motor")
        return 1

    def end_pulses(self) -> bool:
        """Write neutral until it has stood, then off; again and again while the bus refuses. Whether off was taken."""
        limits, begun_ns = self._settings.limits, self._clock_ns()
        neutral_us = self._settings.steering.centre_us, self._settings.throttle.centre_us
        told = False
        while (past_s := (self._clock_ns() - begun_ns) / NS) < _GIVE_UP_S:
            is_due = past_s >= limits.off_s - limits.silence_s
            try:
                if is_due:
                    self._driver.off()
                    return True
                self._driver.set_pulses(*neutral_us)
                told = told or self._tell(neutral_us)
            except OSError:
                pass
            self._sleep(_TRY_S)
        return False

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
            except BlockingIOError:
                continue
            except OSError:
                return True
            if (now_ns := self._clock_ns()) - fed_ns > _WATCHDOG_S * NS:
                fed_ns = now_ns
                notify({"WATCHDOG": "1"})
        return False

    def _pass_on(self, *_: object) -> None:
        """Let the worker stop the car; a signal handler."""
        self._signal(signal.SIGTERM)

    def _signal(self, number: signal.Signals) -> None:
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._process, number)

    def _status(self) -> int | None:
        """Exit status of the worker, or None if it does not die within `_DEATH_S`."""
        if not select.select([self._process], [], [], _DEATH_S)[0]:
            return None
        return os.waitstatus_to_exitcode(os.waitpid(self._pid, 0)[1])

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
    """Say what happened, after the pulses ended: a terminal that is gone or blocks must not keep anyone from that."""
    with suppress(OSError):
        print(f"actuator: {text}", file=sys.stderr, flush=True)


def switch_off(arguments: list[str]) -> int:
    """End all pulses of a PCA9685, whoever left them.

    Args:
        arguments: number or path of the I2C bus, by default 1; address of the board, by default 0x40.
    """
    bus, address = [*arguments, *("1", "0x40")[len(arguments) :]]
    try:
        all_off(Bus(int(bus) if bus.isdecimal() else bus).device(int(address, 0), "PWM board PCA9685"))
    except (TralError, OSError) as error:
        _complain(str(error))
        return 1
    return 0
