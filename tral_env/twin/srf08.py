"""The ultrasonic ranger SRF08 as a model: bytes in, registers out. Source: its data sheet.

The model knows no bus and no car: it asks for the echoes of a ranging, and its clock is an argument.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

GENERAL_CALL = 0x00
COMMAND, GAIN, RANGE, FIRST_ECHO = 0, 1, 2, 2
"""Registers; the range register is written, the first echo is read, both at 2."""
INCH, CM, MICROSECONDS = 0x50, 0x51, 0x52
VERSION, LIGHT, ECHOES, MAX_GAIN = 10, 128, 17, 31
LISTENING_S = 0.065
"""A ranging over the whole range takes this long."""
RANGE_STEP_M = 0.043
_FULL_RANGE = 255
_METRES = {INCH: 0.0254, CM: 0.01, MICROSECONDS: 1.716e-4}
"""What a unit of the reply stands for, m. A microsecond of flight there and back: `UltrasonicConfig.metres_per_us`."""
ANALOGUE_GAIN = (
    94, 97, 100, 103, 107, 110, 114, 118, 123, 128, 133, 139, 145, 152, 159, 168,
    177, 187, 199, 212, 227, 245, 265, 288, 317, 352, 395, 450, 524, 626, 777, 1025,
)  # fmt: skip
"""Greatest gain of the receiver, by the gain register. Source: data sheet."""
HEARS_M = 11.0
"""With the whole gain the ranger hears a wall so far away, m. Source: data sheet, 11 m at the most."""

Echoes = Callable[[float], "Sequence[float] | None"]
"""Gives the ranges of the echoes of a ranging that was fired at a time, s; None: not known yet."""


class Srf08Chip:
    """One ranger."""

    def __init__(self, address: int, echoes: Echoes, clock: Callable[[], float] = time.monotonic) -> None:
        """Power on.

        Args:
            address: its address, 7 bit.
            echoes: of a ranging, m, nearest first.
            clock: gives the time, s.
        """
        self.address, self._echoes, self._clock = address, echoes, clock
        self.silent = False
        """Whether it answers nobody: a broken wire."""
        self.frozen = False
        """Whether its echoes stay what they were, however often it ranges."""
        self.power_cycle()

    def power_cycle(self) -> None:
        """Lose the supply and get it back: full gain, full range, no echo."""
        self._gain, self._range, self._unit, self._pointer = MAX_GAIN, _FULL_RANGE, CM, 0
        self._fired_s: float | None = None
        self._registers = [0] * ECHOES

    def answers_to(self, address: int) -> bool:
        """Whether the ranger listens to an address: its own and the general call."""
        return not self.silent and address in (self.address, GENERAL_CALL)

    @property
    def busy(self) -> bool:
        """Whether the ranger listens for echoes: it takes nothing then, and does not drive the bus."""
        if self._fired_s is None:
            return False
        if self._clock() - self._fired_s < LISTENING_S * (self._range + 1) / (_FULL_RANGE + 1):
            return True
        heard = self._echoes(self._fired_s)
        if heard is None:
            return True
        self._keep(heard)
        return False

    @property
    def fired_s(self) -> float | None:
        """Time at which the ranging that is not read yet was fired, s."""
        return self._fired_s

    def write(self, address: int, data: Sequence[int]) -> bool:
        """Take the bytes of a transaction: a register, and a value for it. Gives back whether it acknowledges."""
        if self.busy:
            return True
        if data:
            self._pointer = data[0]
        if len(data) > 1:
            register, value = data[0], data[1]
            if register == COMMAND and value in _METRES:
                self._fired_s, self._unit = self._clock(), value
            elif register == GAIN:
                self._gain = min(value, MAX_GAIN)
            elif register == RANGE:
                self._range = value
        return True

    def read(self, length: int) -> bytes:
        """Give bytes from the pointer on; 0xFF while it listens, because nobody drives the bus then."""
        if self.busy:
            return b"\xff" * length
        registers = bytes((VERSION, LIGHT)) + b"".join(value.to_bytes(2, "big") for value in self._registers)
        found = registers[self._pointer : self._pointer + length]
        return found + b"\xff" * (length - len(found))

    def _keep(self, heard: Sequence[float]) -> None:
        """Fill the echo registers: what lies within the range register and within the reach of the gain."""
        self._fired_s = None
        if self.frozen:
            return
        reach = min((self._range + 1) * RANGE_STEP_M, HEARS_M * (ANALOGUE_GAIN[self._gain] / ANALOGUE_GAIN[-1]) ** 0.5)
        kept = [min(round(metres / _METRES[self._unit]), 0xFFFF) for metres in sorted(heard) if metres <= reach]
        self._registers = (kept + [0] * ECHOES)[:ECHOES]
