"""The worker: it alone writes to the board while it lives. It hears the policy's process and its own keeper."""

from __future__ import annotations

import select
import signal
import socket
import time
from collections.abc import Callable
from contextlib import suppress

from tral_env.hardware.actuator.drivers import ATTEMPTS, BUDGET_S, Driver
from tral_env.hardware.actuator.guard import OFF, Guard, Pulses
from tral_env.hardware.actuator.settings import Settings
from tral_env.hardware.actuator.stand_in import GIVEN_UP, StandIn
from tral_env.hardware.actuator.wire import ENDED, MAX_PACKET, NS, Reason, State, pack_reply

TICK_S = 0.01
"""The worker looks at its clock at least this often."""
REFRESH_S = 0.1
"""Pulses that do not change are sent again this often."""
_MAX_AT_ONCE = 64
"""The worker reads at most so many packets before it looks at its clock: a flood cannot keep it from that."""
_MAX_UNREAD = 5
"""Settings that could not be read back so often, one after the other, are a fault."""
_LAST_WORD_S = 1.0
"""The worker waits so long for a source that has yet to read earlier replies; no pulses stand then."""
ALIVE = b"."


class Worker:
    """One turn reads packets, asks the guard, writes pulses, and shows the keeper that it lives."""

    def __init__(
        self,
        settings: Settings,
        driver: Driver,
        commands: socket.socket,
        keeper: socket.socket,
        clock_ns: Callable[[], int] = time.monotonic_ns,
        policy: int | None = None,
        shown: StandIn | None = None,
    ) -> None:
        """Take over a board that has been set up; neither socket may block.

        Args:
            settings: what to keep to.
            driver: the board.
            commands: where the policy's process sends commands.
            keeper: where the keeper shows its life.
            clock_ns: monotonic clock, ns.
            policy: file descriptor that becomes readable when the policy's process ends (pidfd): a fork of it that
                holds the socket is no source of commands.
            shown: the stand-in that the board is; None: a board of its own, which is never given up.
        """
        self._settings, self._driver, self._clock_ns = settings, driver, clock_ns
        self._commands, self._keeper, self._policy, self._shown = commands, keeper, policy, shown
        now_ns = clock_ns()
        self.guard = Guard(settings, now_ns)
        self.retries = 0
        self._told = (self.guard.state, self.guard.reason)
        self._wanted: Pulses | None = None
        self._written_ns = self._checked_ns = self._kept_ns = self._shown_ns = now_ns
        self._unread = 0
        self._told_to_end = False

    def end(self, *_: object) -> None:
        """Stop the car and end, at the next turn: a signal handler, which may come amid any line of the guard."""
        self._told_to_end = True

    def run(self) -> int:
        """Work until nobody is left that could command, and no pulses leave the board, however long that takes.

        Returns:
            Exit status 0: the pulses have ended; `GIVEN_UP`: the program behind a stand-in is gone.
        """
        signal.signal(signal.SIGTERM, self.end)
        poll = select.poll()
        sources: list[socket.socket | int] = [self._commands, self._keeper]
        if self._policy is not None:
            sources.append(self._policy)
        for each in sources:
            poll.register(each, select.POLLIN)
        while not self.guard.is_over:
            ready = dict(poll.poll(TICK_S * 1000))
            if self._policy is not None and self._policy in ready:
                poll.unregister(self._policy)
                self.guard.fail(Reason.LOST, self._clock_ns())
            for lost in self.turn(self._commands.fileno() in ready, self._keeper.fileno() in ready):
                poll.unregister(lost)
            if self.guard.ending and self._shown is not None and self._shown.is_given_up(self._clock_ns()):
                return GIVEN_UP
        self.say_ended()
        return 0

    def say_ended(self) -> None:
        """Tell the policy's process that the pulses have ended; one that reads late has time for it now."""
        with suppress(OSError):
            self._commands.settimeout(_LAST_WORD_S)
            self._commands.send(ENDED)

    def turn(self, heard: bool, kept: bool) -> list[socket.socket]:
        """Do one turn; which sockets have something to read is given. Gives back those that ended."""
        if self._told_to_end:
            self.guard.fail(Reason.SIGNAL, self._clock_ns())
        lost = []
        if heard and not self._listen():
            lost.append(self._commands)
            self.guard.fail(Reason.LOST, self._clock_ns())
        if kept and not self._hear_keeper():
            lost.append(self._keeper)
            self.guard.fail(Reason.KEEPER, self._clock_ns())
        self._write()
        self._check_board()
        self._show_life()
        told = (self.guard.state, self.guard.reason)
        if heard or told != self._told:
            self._answer()
        self._told = told
        return lost

    def _listen(self) -> bool:
        """Judge the packets that wait; False: the other end is gone."""
        for _ in range(_MAX_AT_ONCE):
            try:
                packet = self._commands.recv(MAX_PACKET)
            except BlockingIOError:
                return True
            except OSError:
                return False
            if not packet:
                return False
            self.guard.take(packet, self._clock_ns())
        return True

    def _answer(self) -> None:
        """Tell the source of the commands; a source that does not read is told nothing."""
        try:
            self._commands.send(pack_reply(self.guard.reply(self._clock_ns(), self.retries)))
        except OSError:
            return

    def _write(self) -> None:
        """Send the pulses that must stand now, if they changed or are due again."""
        pulses, now_ns = self.guard.pulses(self._clock_ns()), self._clock_ns()
        if pulses == self._wanted and now_ns - self._written_ns < REFRESH_S * NS:
            return
        took = self._attempt(self._driver.off if pulses == OFF else lambda: self._driver.set_pulses(*pulses))
        self._wanted = pulses if took else None
        self._written_ns = self._clock_ns()
        self.guard.sent(pulses, took, self._written_ns)

    def _check_board(self) -> None:
        """Read the board's settings back when due; set a board that lost them up anew, in neutral alone."""
        now_ns = self._clock_ns()
        if self.guard.needs_setup and self.guard.state is State.DISARMED and not self.guard.ending:
            if self._attempt(self._driver.start):
                self.guard.restored()
                self._wanted = None
        elif now_ns - self._checked_ns >= self._settings.limits.check_s * NS:
            self._checked_ns = now_ns
            found: list[str] = []
            self._unread = 0 if self._attempt(lambda: found.append(self._driver.check())) else self._unread + 1
            if self._unread >= _MAX_UNREAD:
                self.guard.fail(Reason.BUS, now_ns)
            elif found and found[-1]:
                self.guard.fail(Reason.BOARD, now_ns)

    def _attempt(self, transaction: Callable[[], object]) -> bool:
        """Try a transaction again within the tick's budget; whether it succeeded."""
        until_ns = self._clock_ns() + round(BUDGET_S * NS)
        for attempt in range(ATTEMPTS):
            if attempt and self._clock_ns() > until_ns:
                return False
            try:
                transaction()
            except Exception:  # a driver that fails in its own way is a board that refuses
                self.retries += 1
                continue
            return True
        return False

    def _show_life(self) -> None:
        """Show the keeper a sign of life; a keeper that shows none for too long is a fault, too."""
        now_ns = self._clock_ns()
        if now_ns - self._shown_ns >= TICK_S * NS:
            self._shown_ns = now_ns
            with suppress(OSError):  # full: the keeper stands still; closed: the poll tells
                self._keeper.send(ALIVE)
        if now_ns - self._kept_ns >= 2 * self._settings.limits.hang_s * NS:
            self.guard.fail(Reason.KEEPER, now_ns)

    def _hear_keeper(self) -> bool:
        """Take the keeper's signs of life; False: it is gone."""
        try:
            packet = self._keeper.recv(MAX_PACKET)
        except BlockingIOError:
            return True
        except OSError:
            return False
        self._kept_ns = self._clock_ns()
        return bool(packet)
