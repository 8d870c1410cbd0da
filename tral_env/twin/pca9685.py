"""The PWM board PCA9685 as a model: bytes in, pulses out. Source: data sheet of NXP, revision 4.

The model knows no bus, no file and no car; its clock is an argument. Register names are those of the data sheet.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

MODE1, MODE2, SUBADR1, ALLCALLADR, LED0_ON_L, ALL_LED_ON_L, PRE_SCALE = 0x00, 0x01, 0x02, 0x05, 0x06, 0xFA, 0xFE
RESTART, EXTCLK, AI, SLEEP, SUB1, SUB2, SUB3, ALLCALL = 0x80, 0x40, 0x20, 0x10, 0x08, 0x04, 0x02, 0x01
INVRT, OUTDRV = 0x10, 0x04
FULL = 0x10
"""In a register LEDn_ON_H or LEDn_OFF_H: the output is always on, or always off."""
GENERAL_CALL, SOFTWARE_RESET = 0x00, 0x06
OUTPUTS, STEPS = 16, 4096
MIN_PRESCALE = 3
WAKE_UP_S = 500e-6
"""The oscillator needs this long after it was woken until the outputs run."""
_LED15_OFF_H = LED0_ON_L + 4 * OUTPUTS - 1
_WRITABLE = {MODE1: 0xFF, MODE2: 0x1F, **dict.fromkeys(range(SUBADR1, ALLCALLADR + 1), 0xFE), PRE_SCALE: 0xFF}
"""Bits that can be written; those of the outputs' high bytes are 0x1F."""


class Pca9685Chip:
    """One board: 16 outputs of 12 bits.

    The outputs follow the registers at once, as they do at the STOP of a transaction. A transaction here is a call.
    """

    def __init__(
        self, oscillator_hz: float = 25e6, address: int = 0x40, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Power on.

        Args:
            oscillator_hz: clock of this very board; owners measured 24.0 to 28.7 MHz.
            address: address that its pins set, 7 bit.
            clock: gives the time, s.
        """
        self.oscillator_hz, self.address, self._clock = oscillator_hz, address, clock
        self.power_cycle()

    def power_cycle(self) -> None:
        """Lose the supply and get it back: all registers have their power-on values."""
        self._registers = bytearray(256)
        self._registers[MODE1], self._registers[MODE2] = SLEEP | ALLCALL, OUTDRV
        self._registers[SUBADR1 : ALLCALLADR + 1] = bytes((0xE2, 0xE4, 0xE8, 0xE0))
        for output in range(OUTPUTS):
            self._registers[LED0_ON_L + 4 * output + 3] = FULL
        self._registers[PRE_SCALE] = 0x1E
        self._pointer, self._woken_s = 0, float("inf")

    def answers_to(self, address: int) -> bool:
        """Whether the board answers to an address: its own, and those that MODE1 switches on; the general call too."""
        mode = self._registers[MODE1]
        extra = (SUB1, SUB2, SUB3, ALLCALL)
        shared = [self._registers[SUBADR1 + k] >> 1 for k, bit in enumerate(extra) if mode & bit]
        return address in (self.address, GENERAL_CALL, *shared)

    def write(self, address: int, data: Sequence[int]) -> bool:
        """Take the bytes of a transaction, the pointer first; gives back whether the board acknowledges."""
        if address == GENERAL_CALL:
            if list(data) != [SOFTWARE_RESET]:
                return False
            self.power_cycle()
            return True
        if not data:
            return True
        self._pointer = data[0]
        for value in data[1:]:
            self._store(self._pointer, value)
            self._advance()
        return True

    def read(self, length: int) -> bytes:
        """Give bytes from the pointer on."""
        found = bytearray()
        for _ in range(length):
            write_only = ALL_LED_ON_L <= self._pointer < PRE_SCALE
            found.append(0 if write_only else self._registers[self._pointer])
            self._advance()
        return bytes(found)

    @property
    def period_us(self) -> float:
        """Time from pulse to pulse, us: 4096 (prescale + 1) / oscillator."""
        return STEPS * self.step_us

    @property
    def step_us(self) -> float:
        """Length of a step, us."""
        return (self._registers[PRE_SCALE] + 1) / self.oscillator_hz * 1e6

    @property
    def runs(self) -> bool:
        """Whether pulses can leave the board: the oscillator runs, and no restart is due."""
        mode = self._registers[MODE1]
        return not mode & (SLEEP | EXTCLK | RESTART) and self._clock() - self._woken_s >= WAKE_UP_S

    def pulse_us(self, output: int) -> float:
        """Time for which an output is high in each period, us; 0: no pulses, the period: always high."""
        if not self.runs:
            return 0.0
        high = self._steps(output)
        if self._registers[MODE2] & INVRT:
            high = STEPS - high
        return high * self.step_us

    def _steps(self, output: int) -> int:
        on_low, on_high, off_low, off_high = self._registers[LED0_ON_L + 4 * output :][:4]
        if off_high & FULL:  # full off goes before full on
            return 0
        if on_high & FULL:
            return STEPS
        return ((off_high << 8 | off_low) - (on_high << 8 | on_low)) % STEPS

    def _advance(self) -> None:
        if self._registers[MODE1] & AI:  # it rolls over behind the outputs, and behind the prescaler
            self._pointer = 0 if self._pointer in (_LED15_OFF_H, PRE_SCALE) else (self._pointer + 1) % 256

    def _store(self, register: int, value: int) -> None:
        if register == MODE1:
            self._store_mode(value)
        elif register == PRE_SCALE:
            if self._registers[MODE1] & SLEEP:  # else the write is ignored
                self._registers[PRE_SCALE] = max(value, MIN_PRESCALE)
        elif LED0_ON_L <= register <= _LED15_OFF_H:
            self._store_output(register, value)
        elif ALL_LED_ON_L <= register < PRE_SCALE:
            for output in range(OUTPUTS):
                self._store_output(LED0_ON_L + 4 * output + register - ALL_LED_ON_L, value)
        elif register in _WRITABLE:
            self._registers[register] = value & _WRITABLE[register]

    def _store_output(self, register: int, value: int) -> None:
        high_byte = (register - LED0_ON_L) % 2
        self._registers[register] = value & (0x1F if high_byte else 0xFF)
        self._registers[MODE1] &= ~RESTART & 0xFF  # new pulses make a restart unnecessary

    def _store_mode(self, value: int) -> None:
        """MODE1: RESTART is set by a sleep amid pulses and cleared by writing 1; EXTCLK stays until a power cycle."""
        before = self._registers[MODE1]
        restart = before & RESTART
        if value & SLEEP and not before & SLEEP:
            restart = RESTART if any(self._steps(output) for output in range(OUTPUTS)) else 0
        elif value & RESTART and not value & SLEEP and not before & SLEEP:
            restart = 0
        extclk = before & EXTCLK or (EXTCLK if value & EXTCLK and before & SLEEP else 0)
        self._registers[MODE1] = value & ~(RESTART | EXTCLK) & 0xFF | restart | extclk
        if before & SLEEP and not value & SLEEP:
            self._woken_s = self._clock()
