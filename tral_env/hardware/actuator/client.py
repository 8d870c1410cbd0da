"""The policy's end: it starts the actuator's process, sends commands, and tells what became of them."""

from __future__ import annotations

import importlib.util
import json
import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Set
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from tral_env.errors import ActuatorLostError, HardwareError, MissingExtraError
from tral_env.hardware.actuator.drivers import BOARDS, board_class
from tral_env.hardware.actuator.guard import OFF
from tral_env.hardware.actuator.laws import pulse_us
from tral_env.hardware.actuator.settings import Settings
from tral_env.hardware.actuator.stand_in import GIVEN_UP
from tral_env.hardware.actuator.wire import (
    ENDED,
    MAX_PACKET,
    NS,
    TOLD,
    CommandPacket,
    Flag,
    Reason,
    Reply,
    State,
    pack,
    read_reply,
)
from tral_env.hardware.physical import Physical

_START_S = 10.0
"""The process is ready after this time, or it counts as broken."""
_ANSWER_S = 0.5
"""The worker answers a command within this time, or it counts as lost."""
_ARM_S = 2.0
"""Arming takes at most so much longer than neutral has to stand."""
_HEARTBEAT_S = 0.0125
"""While the client waits, it sends neutral this often: a control period."""
_END_S = 3.0
"""The process ends within this time if the board takes pulses."""
_POWER = "Cut the power of the motor."
_QUIET = frozenset({Reason.NONE, Reason.SILENCE})
"""After these nobody has to look at the car before it may drive again."""


class ActuatorProcess(Physical):
    """The actuator's process, as its only source of commands.

    The process stands in a session of its own: Ctrl-C, Ctrl-Z and the end of a terminal do not reach it. It stops the
    car when this end is closed, whatever the reason.
    """

    def __init__(self, settings: Settings) -> None:
        """Start the process; it has sent neutral then, and is disarmed.

        Raises:
            MissingExtraError: the library of the bus is not installed.
            HardwareError: the board does not answer.
        """
        self._settings, self._owner, self._has_ended = settings, os.getpid(), False
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-I", str(Path(__file__).with_name("__main__.py")), str(theirs.fileno()),
                 settings.to_json(), *library_folders(settings.driver)],
                pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, start_new_session=True,
            )  # fmt: skip
        self._sequence, self._evidence = 0, 0
        self._reply: Reply | None = None
        try:
            self.hello = self._hello()
            """Process ids of `worker` and `keeper`, and whether `realtime`, `locked` and `spared` were granted."""
        except BaseException:
            self._socket.close()  # the process ends by itself, and with it the pulses
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(_END_S)
            raise

    @property
    def applied(self) -> tuple[float, float]:
        """Steering and throttle as the worker applied them last."""
        return (0.0, 0.0) if self._reply is None else (self._reply.steering, self._reply.throttle)

    @property
    def pulses_us(self) -> tuple[float, float]:
        """Pulses that the worker sent last, us; 0: none."""
        if self._reply is None:
            return self._settings.steering.centre_us, self._settings.throttle.centre_us
        return self._reply.steering_us, self._reply.throttle_us

    @property
    def retries(self) -> int:
        """Number of transactions with the board that were tried again."""
        return 0 if self._reply is None else self._reply.retries

    @property
    def reply(self) -> Reply | None:
        """What the worker told last."""
        return self._reply

    def arm(self) -> str:
        """Hold neutral until the worker lets the motor go, whatever stopped the car; at once if it did so already.

        Returns:
            What had stopped the car, in words; empty: nothing.

        Raises:
            HardwareError: the worker does not arm, with its reason.
        """
        return self._arm(frozenset(Reason))

    def resume(self) -> None:
        """Arm again after a silence; at once if it is armed.

        Raises:
            HardwareError: anything else stopped the car, which only `arm` undoes; or the worker does not arm.
        """
        self._arm(_QUIET)

    def stop(self) -> None:
        """Stop the car at once, in an emergency; only `arm` undoes it.

        Raises:
            HardwareError: the process is gone.
        """
        self._send(0.0, 0.0, Flag.STOP)

    def command(self, steering: float, throttle: float, evidence: int) -> None:
        """Send a command, at once; the worker brings it within all limits.

        Args:
            steering: share of full lock, +1 = full left.
            throttle: share of full throttle, +1 = full forward.
            evidence: number of observations until now that differed from the one before.

        Raises:
            HardwareError: the process is gone.
        """
        self._evidence = evidence
        self._send(steering, throttle)

    def check(self) -> None:
        """Hear what the worker told about the last command; call it some milliseconds after that.

        Raises:
            HardwareError: it does not let the motor go any more, with its reason; or it is gone.
        """
        self._hear()
        if self._reply is None or time.monotonic_ns() - self._reply.stamp_ns > _ANSWER_S * NS:
            raise HardwareError(f"the actuator's process does not answer. {_POWER}")
        if self._reply.state is State.DISARMED:
            raise HardwareError("the actuator is not armed: arm it before the first command")
        if self._reply.state is State.LATCHED:
            raise HardwareError(f"the actuator stopped the car: {TOLD[self._reply.reason]}")

    def neutral(self) -> None:
        """Go to neutral, disarmed, and wait until the worker did.

        Raises:
            HardwareError: the board does not take pulses; or the process is gone, whose keeper ends the pulses.
        """
        until_s = time.monotonic() + _ANSWER_S
        while not self._stands(self._ask(Flag.DISARM)):
            if time.monotonic() > until_s:
                raise HardwareError(f"{TOLD[Reason.BUS]}. {_POWER}")
            time.sleep(_HEARTBEAT_S)

    def close(self) -> None:
        """Let go of the process, which ends in neutral, then no pulses; wait for that. A second call does nothing.

        Raises:
            HardwareError: the pulses could not be ended. The process goes on trying, unless the board is a stand-in
                whose program is gone; another call waits again.
        """
        if os.getpid() != self._owner:  # a fork: the process is not its own
            return
        with suppress(OSError):  # whoever else holds this end, the worker hears that it has ended
            self._socket.shutdown(socket.SHUT_WR)
        until_s = time.monotonic() + _END_S
        while not self._has_ended and (left_s := until_s - time.monotonic()) > 0.0:
            if not self._hears_within(left_s):
                break
        if not self._has_ended and self._process.poll() != GIVEN_UP:
            raise HardwareError(f"the actuator's process could not end the pulses yet. {_POWER}")
        self._socket.close()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_S)

    def __enter__(self) -> Self:
        """The process itself, disarmed."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it, whatever happened."""
        self.close()

    def _hears_within(self, seconds: float) -> bool:
        """Wait for a packet and take it; False: there was none in that time, or there will be none."""
        try:
            self._socket.settimeout(seconds)
            packet = self._socket.recv(MAX_PACKET)
        except ConnectionResetError:  # it ended without reading all; its last word may still wait
            return True
        except OSError:
            return False
        if not packet:
            self._socket.close()
        self._take(packet)
        return bool(packet)

    def _take(self, packet: bytes) -> None:
        """Take a reply, or the last word."""
        self._has_ended = self._has_ended or packet == ENDED
        self._reply = read_reply(packet) or self._reply

    def _arm(self, undone: Set[Reason]) -> str:
        """Hold neutral until the worker is armed, unless another reason than those to be undone latched it."""
        until_s, flags, told = time.monotonic() + self._settings.limits.arming_s + _ARM_S, Flag.NONE, ""
        # A latch is undone by an ARM that was not there before, so the first question does not have it.
        while (reply := self._ask(flags)).state is not State.ARMED:
            if reply.state is State.LATCHED and reply.reason not in undone:
                raise HardwareError(f"the actuator stopped the car: {TOLD[reply.reason]}. Only a reset arms it again")
            if reply.state is State.LATCHED and flags is Flag.NONE:
                told = TOLD[reply.reason]
            if time.monotonic() > until_s:
                raise HardwareError(f"the actuator does not arm: {TOLD[reply.reason]}")
            flags = Flag.ARM
            time.sleep(_HEARTBEAT_S)
        return told

    def _stands(self, reply: Reply) -> bool:
        """Whether the board has the pulses that the worker wants for a car that does not drive."""
        settings, sent = self._settings, (reply.steering_us, reply.throttle_us)
        wanted = pulse_us(reply.steering, settings.steering), pulse_us(reply.throttle, settings.throttle)
        return reply.state is not State.ARMED and sent in (wanted, OFF)

    def _hello(self) -> Mapping[str, Any]:
        self._socket.settimeout(_START_S)
        try:
            packet = self._socket.recv(MAX_PACKET)
        except TimeoutError as error:
            raise HardwareError(f"the actuator's process did not begin within {_START_S:g} s") from error
        if not packet:
            raise HardwareError("the actuator's process ended before it began; its error stands above")
        hello: dict[str, Any] = json.loads(packet)
        if "missing" in hello:
            raise MissingExtraError(*hello["missing"])
        if "error" in hello:
            raise HardwareError(hello["error"])
        return hello

    def _send(self, steering: float, throttle: float, flags: Flag = Flag.NONE) -> None:
        if os.getpid() != self._owner:
            raise HardwareError(
                "this process is a fork of the one that opened the car: only that one may drive, and its end stops the "
                "car"
            )
        self._sequence += 1
        command = CommandPacket(self._sequence, time.monotonic_ns(), steering, throttle, self._evidence, flags)
        try:
            self._socket.settimeout(_ANSWER_S)
            self._socket.send(pack(command))
        except OSError as error:
            raise self._lost() from error

    def _hear(self) -> None:
        """Take the replies that wait; the newest counts."""
        try:
            self._socket.setblocking(False)
            while packet := self._socket.recv(MAX_PACKET):
                self._take(packet)
        except BlockingIOError:
            return
        except OSError as error:
            raise self._lost() from error
        raise self._lost()

    def _ask(self, flags: Flag) -> Reply:
        """Send neutral with flags, again where it is not taken, and wait for the answer."""
        until_s = time.monotonic() + _ANSWER_S
        while time.monotonic() < until_s:
            self._send(0.0, 0.0, flags)
            while select.select([self._socket], [], [], 4 * _HEARTBEAT_S)[0]:
                self._hear()
                if self._reply is not None and self._reply.reason is Reason.WORKER:
                    raise self._lost()
                if self._reply is not None and self._reply.sequence == self._sequence:
                    return self._reply
        raise HardwareError(f"the actuator's process does not answer. {_POWER}")

    def _lost(self) -> ActuatorLostError:
        reason = Reason.NONE if self._reply is None else self._reply.reason
        told = f": {TOLD[reason]}" if reason is not Reason.NONE else ""
        return ActuatorLostError(f"the actuator's process is gone; its keeper ends the pulses{told}. Open the car anew")


def library_folders(driver: str) -> list[str]:
    """Folders of the libraries of the buses and of the driver.

    An isolated interpreter does not find them by itself if only this user has them.
    """
    names = ["smbus2", "serial"]
    if driver not in BOARDS:
        names.append(board_class(driver).__module__.partition(".")[0])
    specs = [importlib.util.find_spec(name) for name in names]
    modules = [Path(spec.origin) for spec in specs if spec is not None and spec.origin is not None]
    folders = [module.parents[1] if module.name == "__init__.py" else module.parent for module in modules]
    return list(dict.fromkeys(map(str, folders)))
