"""One drive in a car, in real time: armed by an explicit act, watched in each tick, summed up at its end."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tral_env.errors import HardwareError, TralError
from tral_env.interface import CONTROL_PERIOD_S, CONTROL_RATE_HZ
from tral_fsm.programs.seat import Moment, Seat
from tral_fsm.teleop.overseer import End, Overseer

_STATUS_S = 0.25
"""The status line is renewed this often, s."""
_POLL_S = 0.02
"""Before the drive, all devices are polled this often, s."""


Show = Callable[[Mapping[str, float], tuple[float, float]], None]
"""Is told the readings and the steering and throttle of a tick."""


class Console(Protocol):
    """Where a drive tells what happens."""

    def status(self, text: str) -> None:
        """Show the line of the moment."""

    def say(self, text: str) -> None:
        """Tell something that stays."""


class Tally:
    """Sums up the ticks of a drive."""

    def __init__(self) -> None:
        self.ends_s: list[float] = []
        """Time at which each tick ended, s."""
        self.state_s: dict[str, float] = {}
        """Time in each state, s."""
        self.warnings: list[str] = []
        self.last: Moment | None = None

    def add(self, now_s: float, state: str, moment: Moment) -> list[str]:
        """Count a tick; gives the warnings that are new."""
        self.ends_s.append(now_s)
        self.state_s[state] = self.state_s.get(state, 0.0) + CONTROL_PERIOD_S
        told = {text.split(":")[0] for text in self.warnings}
        fresh = [text for text in moment.warnings if text.split(":")[0] not in told]
        self.warnings += fresh
        self.last = moment
        return fresh

    def reading(self, name: str) -> float | None:
        """A reading of the last tick; None: the car has none of that name."""
        return None if self.last is None else self.last.readings.get(name)

    @property
    def lateness_ms(self) -> NDArray[np.float64]:
        """Of each tick but the first, by how much more than a period it took, ms."""
        extra: NDArray[np.float64] = np.maximum(np.diff(self.ends_s) - CONTROL_PERIOD_S, 0.0) * 1e3
        return extra

    def figures(self) -> dict[str, Any]:
        """Numbers of the drive."""
        late = self.lateness_ms
        ticks = len(self.ends_s)
        percentiles = np.percentile(late, [50, 99, 100]).tolist() if late.size else [0.0, 0.0, 0.0]
        distance = self.reading("distance") or 0.0
        return {
            "ticks": ticks,
            "time_s": ticks * CONTROL_PERIOD_S,
            "distance_m": distance,
            "mean_speed_mps": distance / (ticks * CONTROL_PERIOD_S) if ticks else 0.0,
            "late_ticks": 0 if self.last is None else self.last.late_ticks,
            "lateness_ms": dict(zip(("p50", "p99", "max"), percentiles, strict=True)),
            "retries": 0 if self.last is None else self.last.retries,
            "states_s": dict(self.state_s),
        }


def status_text(tally: Tally, state: str) -> str:
    """The line of the moment: time, rate, lateness, ranges, speed, state, battery."""
    if tally.last is None:
        return ""
    recent = tally.ends_s[-int(CONTROL_RATE_HZ) :]
    rate = (len(recent) - 1) / (recent[-1] - recent[0]) if len(recent) > 1 and recent[-1] > recent[0] else 0.0
    ticks = len(tally.ends_s)
    parts = [f"{ticks * CONTROL_PERIOD_S:6.1f} s", f"{rate:4.0f} Hz", f"late {tally.last.late_ticks / ticks:.1%}"]
    for side in ("left", "front", "right"):
        if (metres := tally.reading(f"ultrasonic_{side}")) is not None:
            parts.append(f"{side[0].upper()} {metres:.2f} m")
    if (speed := tally.reading("speed")) is not None:
        parts.append(f"{speed:.2f} m/s")
    if volts := tally.reading("battery"):
        parts.append(f"{volts:.1f} V")
    return "  ".join([*parts, state])


@contextmanager
def short_collections() -> Iterator[None]:
    """Keep Python's garbage collector away from all that was there before the block.

    The program has tens of thousands of objects, and the collector would go through them all now and then: 30 ms of a
    fast computer in the middle of a drive, and more on that of a car, which goes to neutral after 100 ms of silence.
    """
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


class CarDrive:
    """Drives once."""

    def __init__(
        self,
        seat: Seat,
        policy: Any,
        overseer: Overseer,
        console: Console,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        show: Show | None = None,
    ) -> None:
        """Prepare a drive; nothing moves.

        Args:
            seat: in the car.
            policy: drives.
            overseer: hears the people.
            console: where the drive tells what happens.
            clock: clock of the drive, s.
            sleep: waits some seconds.
            show: is told the readings and the answer of each tick; it must not wait.
        """
        self._seat, self._policy, self._overseer, self._console = seat, policy, overseer, console
        self._clock, self._sleep, self._show = clock, sleep, show
        self.tally = Tally()

    def run(self, how_to_arm: str) -> End:
        """Wait until somebody arms, drive, and stop the car.

        Args:
            how_to_arm: what to do, for a person; empty: it is armed already, by an option of the command line.

        Raises:
            PolicyError: the policy failed; the car was stopped.
        """
        if how_to_arm and (end := self._wait(how_to_arm)):
            return end
        self._policy.reset(1)
        try:
            with short_collections():
                end = self._drive()
        except BaseException as error:
            self._stop(f"{type(error).__name__}: {error}", failed=True)
            if not isinstance(error, HardwareError):
                raise
            return End(str(error), failed=True)
        self._stop(end.why, failed=end.failed)
        return end

    def _wait(self, how_to_arm: str) -> End | None:
        """Wait until somebody arms; what was pressed before this was asked may end the drive, and never arms."""
        if end := self._overseer.before_asking():
            return end
        self._console.say(how_to_arm)
        while True:
            asked = self._overseer.asks_to_arm()
            if isinstance(asked, End):
                return asked
            if asked:
                return None
            self._sleep(_POLL_S)

    def _drive(self) -> End:
        observation, told_s = self._seat.begin(self._policy), self._clock()
        while True:
            if end := self._overseer.look():
                return end
            action = self._policy.act(observation)
            moment = self._seat.step(action)
            observation, now_s = moment.observation, self._clock()
            if self._show is not None:
                self._show(moment.readings, (float(action[0]), float(action[1])))
            states = getattr(self._policy, "active_states", None) or [""]
            for warning in self.tally.add(now_s, states[0], moment):
                self._console.say(warning)
                self._seat.say(warning, "warning")
            if moment.over:
                return End(moment.over)
            if now_s - told_s >= _STATUS_S:
                told_s = now_s
                self._console.status(status_text(self.tally, states[0]))

    def _stop(self, why: str, *, failed: bool) -> None:
        """Stop the car, and say why in the recording; a stop that fails is left to the actuator's process."""
        try:
            self._seat.stop()
        except TralError as error:
            self._console.say(f"the stop could not be commanded: {error}")
        self._seat.say(f"the drive has ended: {why}", "error" if failed else "info")


def report_of(arguments: Mapping[str, Any], tally: Tally, end: End, recording: str) -> dict[str, Any]:
    """The content of summary.json."""
    from tral_env.recording.about import versions

    return {
        "arguments": dict(arguments),
        "versions": versions(),
        "ended_by": end.why,
        "failed": end.failed,
        "figures": tally.figures(),
        "warnings": list(tally.warnings),
        "recording": recording,
    }
