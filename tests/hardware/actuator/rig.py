"""A guard, a worker and a keeper on a clock that the test moves, and a board that fails on demand."""

from __future__ import annotations

import select
import socket
from dataclasses import replace
from typing import Any

from tral_env.hardware.actuator.guard import Guard, Pulses
from tral_env.hardware.actuator.laws import Channel
from tral_env.hardware.actuator.settings import Limits, Settings
from tral_env.hardware.actuator.wire import CommandPacket, Flag, Reply, State, pack, read_reply
from tral_env.hardware.actuator.worker import Worker

MS = 1_000_000
NEUTRAL: Pulses = (1530.0, 1500.0)
OFF: Pulses = (0.0, 0.0)
STEERING = Channel(0, 1810.0, 1530.0, 1240.0, 0.0, 1240.0, 1810.0, 0.0)
THROTTLE = Channel(1, 1900.0, 1500.0, 1100.0, 0.0, 1100.0, 1900.0, 40.0)
"""Full forward is 1100 us, full reverse 1900 us, and the motor rests within 40 us."""
SETTINGS = Settings(
    driver="log", bus="/dev/null", period_us=17430, oscillator_hz=25e6, steering=STEERING, throttle=THROTTLE
)


def settings(steering: Channel = STEERING, throttle: Channel = THROTTLE, **limits: Any) -> Settings:
    """Settings with some limits; neutral need not stand before arming, unless a test says so."""
    limits = {"arming_s": 0.0, "evidence_s": None} | limits
    return replace(SETTINGS, steering=steering, throttle=throttle, limits=Limits(**limits))


class Bench:
    """A guard and the source of its commands."""

    def __init__(self, given: Settings | None = None) -> None:
        self.now_ns = 100_000 * MS
        self.guard = Guard(given or settings(), self.now_ns)
        self.sequence = self.evidence = 0
        self.board_takes = True

    def wait(self, ms: float) -> Pulses:
        """Let time pass in turns of 10 ms, as the worker does; the pulses at its end."""
        end_ns = self.now_ns + round(ms * MS)
        pulses = self.write()
        while self.now_ns < end_ns:
            self.now_ns = min(self.now_ns + 10 * MS, end_ns)
            pulses = self.write()
        return pulses

    def write(self) -> Pulses:
        pulses = self.guard.pulses(self.now_ns)
        self.guard.sent(pulses, self.board_takes, self.now_ns)
        return pulses

    def send(self, throttle: float = 0.0, steering: float = 0.0, flags: Flag = Flag.NONE, **changes: Any) -> Pulses:
        """Give the guard a command that is right but for some changes; the pulses after it."""
        self.sequence += 1
        command = CommandPacket(self.sequence, self.now_ns, steering, throttle, self.evidence, flags)
        return self.give(pack(command._replace(**changes)))

    def give(self, packet: bytes) -> Pulses:
        self.guard.take(packet, self.now_ns)
        return self.write()

    def arm(self) -> Bench:
        self.write()
        self.send(flags=Flag.ARM)
        assert self.guard.state is State.ARMED
        return self

    def arm_after(self, ms: float) -> Bench:
        """Let neutral stand, then arm."""
        self.wait(ms)
        return self.arm()

    def drive(self, ms: float, throttle: float, *, seeing: bool = True, steering: float = 0.0) -> Pulses:
        """Send commands at the control rate; the pulses after the last one."""
        for _ in range(round(ms / 12.5)):
            self.wait(12.5)
            self.evidence += seeing
            pulses = self.send(throttle, steering)
        return pulses

    @property
    def reply(self) -> Reply:
        return self.guard.reply(self.now_ns, 0)


class Clock:
    """Nanoseconds that pass when a test says so, or by sleeping."""

    def __init__(self) -> None:
        self.now_ns = 100_000 * MS

    def __call__(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)


class FakeBoard:
    """A driver that fails, or has lost its settings, on demand."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.done: list[tuple[int, str, Pulses]] = []
        """Time, method and pulses of every transaction that was taken."""
        self.failures = self.tries = 0
        """So many transactions from now on fail; so many were tried."""
        self.error: Exception = OSError(121, "Remote I/O error")
        """A transaction fails so."""
        self.takes_ms = 0.0
        """A transaction takes so long."""
        self.lost, self.cannot_be_read = "", False

    def start(self) -> None:
        self._do("start", NEUTRAL)
        self.lost = ""

    def set_pulses(self, steering_us: float, throttle_us: float) -> None:
        self._do("pulses", (steering_us, throttle_us))

    def off(self) -> None:
        self._do("off", OFF)

    def check(self) -> str:
        if self.cannot_be_read:
            raise OSError(121, "Remote I/O error")
        self._do("check", OFF)
        return self.lost

    def _do(self, method: str, pulses: Pulses) -> None:
        self.tries += 1
        self.clock.now_ns += round(self.takes_ms * MS)
        if self.failures:
            self.failures -= 1
            raise self.error
        self.done.append((self.clock.now_ns, method, pulses))

    @property
    def stands(self) -> Pulses:
        """Pulses that leave the board."""
        return next(pulses for _, method, pulses in reversed(self.done) if method != "check")


class Works:
    """A worker whose turns a test makes, with both ends of its sockets."""

    def __init__(self, given: Settings | None = None) -> None:
        self.clock = Clock()
        self.board = FakeBoard(self.clock)
        self.board.start()
        self.source, commands = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.keeper, kept = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        for each in (self.source, commands, self.keeper, kept):
            each.setblocking(False)
        self.ends = commands, kept
        self.worker = Worker(given or settings(), self.board, commands, kept, self.clock)
        self.sequence = 0
        self.keeper_lives = True

    def turn(self, ms: float = 10.0) -> list[socket.socket]:
        self.clock.now_ns += round(ms * MS)
        if self.keeper_lives and self.keeper.fileno() >= 0:
            self.keeper.send(b".")
        waits, _, _ = select.select(self.ends, [], [], 0)
        return self.worker.turn(self.ends[0] in waits, self.ends[1] in waits)

    def turns(self, ms: float) -> None:
        for _ in range(round(ms / 10)):
            self.turn()

    def send(self, throttle: float = 0.0, flags: Flag = Flag.NONE) -> None:
        self.sequence += 1
        self.source.send(pack(CommandPacket(self.sequence, self.clock.now_ns, 0.0, throttle, self.sequence, flags)))

    def arm(self) -> Works:
        self.turn()
        self.send(flags=Flag.ARM)
        self.turn()
        assert self.worker.guard.state is State.ARMED
        return self

    def drive(self, ms: float, throttle: float) -> None:
        for _ in range(round(ms / 10)):
            self.send(throttle)
            self.turn()

    def told(self) -> list[Reply]:
        """Replies that wait."""
        replies = []
        while True:
            try:
                reply = read_reply(self.source.recv(4096))
            except BlockingIOError:
                return replies
            assert reply is not None
            replies.append(reply)

    def close(self) -> None:
        for each in (self.source, self.keeper, *self.ends):
            each.close()
