"""A bench whose board is a fake behind the real guard and worker, on a clock of its own; and a person with a script."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from rig import MS, OFF, Pulses, Works

from tral_env.errors import HardwareError
from tral_env.hardware.actuator.settings import Settings
from tral_env.hardware.actuator.wire import CommandPacket, Flag, State, pack
from tral_env.hardware.bringup.bench import Bench
from tral_env.hardware.bringup.person import Person

FILE = """\
version = 1
name = "mine"  # a comment that stays
[board]
driver = "pca9685"
# the clock
oscillator_hz = 25e6
clock_measured = true
period_us = 17430
[pulses]
file = "tt01"
"""


class Workbench:
    """What a person at the bench sees: boards that were opened, and the pulses that stood."""

    def __init__(self) -> None:
        self.now_ns = 100_000 * MS
        self.opened: list[RigActuator] = []
        self.on_sleep: Callable[[float], None] = lambda now: None
        self.bench = Bench(self.start, self.clock, self.sleep)

    def start(self, settings: Settings) -> RigActuator:
        self.opened.append(RigActuator(self, settings))
        return self.opened[-1]

    def clock(self) -> float:
        return self.now_ns / 1e9

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)
        for each in self.opened:
            each.pass_time(seconds * 1e3)
        self.on_sleep(self.clock())

    @property
    def pulses(self) -> list[Pulses]:
        """Pulses that stood, one after the other, of all boards."""
        found: list[Pulses] = []
        for each in self.opened:
            for _, method, pulses in each.works.board.done:
                if method in ("pulses", "off") and (not found or found[-1] != pulses):
                    found.append(pulses)
        return found

    @property
    def rests(self) -> bool:
        """Whether every board that was opened sends no pulses any more, after neutral."""
        return all(each.works.board.stands == OFF for each in self.opened)


class RigActuator:
    """The worker of the actuator's process in this process, as `Actuator`."""

    hello = {"realtime": False, "locked": True}  # noqa: RUF012

    def __init__(self, workbench: Workbench, settings: Settings) -> None:
        self.settings = settings
        self.works = Works(settings)
        self.works.clock.now_ns = workbench.now_ns
        self.works.worker = type(self.works.worker)(settings, self.works.board, *self.works.ends, self.works.clock)
        self._closed = False
        self.works.turn(0.0)

    def pass_time(self, ms: float) -> None:
        if not self._closed:
            self.works.turn(ms)

    @property
    def applied(self) -> tuple[float, float]:
        reply = self.works.worker.guard.reply(self.works.clock.now_ns, 0)
        return reply.steering, reply.throttle

    @property
    def pulses_us(self) -> Pulses:
        return self.works.board.stands

    def arm(self) -> str:
        for _ in range(round(self.settings.limits.arming_s * 100) + 50):
            self._send(0.0, 0.0, Flag.ARM)
            self.works.turn()
            if self.works.worker.guard.state is State.ARMED:
                return ""
        raise HardwareError("the actuator does not arm")

    def resume(self) -> None:
        self.arm()

    def command(self, steering: float, throttle: float, evidence: int) -> None:
        del evidence
        self._send(steering, throttle, Flag.NONE)

    def check(self) -> None:
        self.works.told()
        if self.works.worker.guard.state is not State.ARMED:
            raise HardwareError("the actuator stopped the car")

    def neutral(self) -> None:
        self._send(0.0, 0.0, Flag.DISARM)
        self.works.turn(0.0)
        self.works.told()

    def close(self) -> None:
        self._closed = True
        self.works.source.close()
        for _ in range(100):
            self.works.turn()
        self.works.close()

    def _send(self, steering: float, throttle: float, flags: Flag) -> None:
        self.works.sequence += 1
        now_ns = self.works.clock.now_ns
        self.works.source.send(pack(CommandPacket(self.works.sequence, now_ns, steering, throttle, 0, flags)))
        self.works.told()


class Script:
    """A person who answers one line after the other."""

    def __init__(self, answers: Iterable[str | Callable[[], str]]) -> None:
        self._answers = iter(answers)
        self.said: list[str] = []
        self.asked: list[str] = []
        self.person = Person(self.said.append, self._read)

    def _read(self, question: str) -> str:
        self.asked.append(question)
        try:
            answer = next(self._answers)
        except StopIteration:
            raise EOFError from None
        return answer if isinstance(answer, str) else answer()

    @property
    def told(self) -> str:
        return "\n".join(self.said)


def car_file(folder: Path, text: str = FILE) -> Path:
    path = folder / "car.toml"
    path.write_text(text)
    return path
