"""Devices that behave like their data sheets say, on a virtual clock."""

from __future__ import annotations

from collections.abc import Callable, Sequence


class Clock:
    """Time that passes only by sleeping."""

    def __init__(self) -> None:
        self.now = 100.0
        self.naps: list[float] = []

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.naps.append(seconds)
        self.now += seconds


class Pca9685Fake:
    """Sixteen outputs of twelve bits."""

    def __init__(self, oscillator_hz: float = 25e6) -> None:
        self.registers = bytearray(256)
        self.registers[0x00], self.registers[0x01], self.registers[0xFE] = 0x11, 0x04, 0x1E
        for channel in range(16):
            self.registers[0x09 + 4 * channel] = 0x10  # full off
        self.oscillator_hz = oscillator_hz
        self.seen: list[tuple[float, float]] = []
        """Pulses of channels 0 and 1 after each transaction, while awake."""

    @property
    def awake(self) -> bool:
        return not self.registers[0x00] & 0x10

    def answers_to(self, own: int, address: int) -> bool:
        return address == own or (address == 0x70 and bool(self.registers[0x00] & 0x01))

    def write(self, register: int, data: Sequence[int]) -> None:
        for value in data:
            self._store(register, value)
            if self.registers[0x00] & 0x20:
                register += 1
        if self.awake:
            self.seen.append((self.pulse_us(0), self.pulse_us(1)))

    def read(self, register: int, length: int) -> list[int]:
        return list(self.registers[register : register + length])

    def _store(self, register: int, value: int) -> None:
        if register == 0xFE and self.awake:
            return  # the divider is locked while the oscillator runs
        if register == 0x00:
            was_awake, restart = self.awake, self.registers[0] & 0x80
            if value & 0x80 and restart:
                restart = 0
            elif value & 0x10 and was_awake and any(self.pulse_us(channel) for channel in range(16)):
                restart = 0x80
            value = (value & 0x7F) | restart
        self.registers[register] = value
        if 0xFA <= register <= 0xFD:  # of all outputs at once
            self.registers[register - 0xFA + 0x06 : 0x46 : 4] = bytes([value] * 16)
        if 0x06 <= register <= 0x45:
            self.registers[0] &= 0x7F  # new pulses make a restart unnecessary

    def pulse_us(self, channel: int) -> float:
        """Length of the pulse that leaves the pin."""
        on_low, on_high, off_low, off_high = self.registers[0x06 + 4 * channel : 0x0A + 4 * channel]
        if not self.awake or off_high & 0x10:
            return 0.0
        tick_us = (self.registers[0xFE] + 1) / self.oscillator_hz * 1e6
        return (((off_high & 15) << 8 | off_low) - ((on_high & 15) << 8 | on_low)) % 4096 * tick_us


class Srf08Fake:
    """Ultrasonic ranger that hears a wall at a distance."""

    def __init__(self, clock: Callable[[], float], metres: float | None = 1.0, silent: bool = False) -> None:
        self.clock, self.metres = clock, metres
        self.silent = silent
        """Whether the bus driver reports a busy ranger as an error, and not as 0xFF."""
        self.gain, self.range, self.stuck = 31, 255, False
        self.fired: list[float] = []
        self.command = 0x51

    @property
    def busy(self) -> bool:
        listening = (self.range + 1) * 0.043 * 2 / 343
        return self.stuck or (bool(self.fired) and self.clock() - self.fired[-1] < listening)

    def answers_to(self, own: int, address: int) -> bool:
        return address in (own, 0x00) and not (self.silent and self.busy)

    def write(self, register: int, data: Sequence[int]) -> None:
        if self.busy:
            return
        (value,) = data
        if register == 0:
            assert value in (0x51, 0x52)
            self.command = value
            self.fired.append(self.clock())
        elif register == 1:
            self.gain = value
        elif register == 2:
            self.range = value

    def read(self, register: int, length: int) -> list[int]:
        if self.busy:
            return [0xFF] * length
        heard = self.metres is not None and self.metres <= (self.range + 1) * 0.043 and self.fired
        unit = {0x51: 0.01, 0x52: 1.716e-4}[self.command]
        echo = round(self.metres / unit) if heard else 0
        return [10, 128, echo >> 8, echo & 0xFF][register : register + length]


class Srf02Fake(Srf08Fake):
    """Ultrasonic ranger that hears its own address alone, and does not answer while it listens."""

    def __init__(self, clock: Callable[[], float], metres: float | None = 1.0) -> None:
        super().__init__(clock, metres, silent=True)

    def answers_to(self, own: int, address: int) -> bool:
        return address == own and not self.busy

    def write(self, register: int, data: Sequence[int]) -> None:
        assert register == 0, "only the command can be written"
        super().write(register, data)


class FakeSmbus:
    """Speaks like ``smbus2.SMBus``."""

    def __init__(self, devices: dict[int, Pca9685Fake | Srf08Fake]) -> None:
        self.devices = devices
        self.log: list[tuple[int, int, tuple[int, ...]]] = []
        """Every write: address, register, bytes."""
        self.failures = 0
        """So many transactions from now on fail."""
        self.closed = False

    def _answering(self, address: int) -> list[Pca9685Fake | Srf08Fake]:
        if self.failures:
            self.failures -= 1
            raise OSError(121, "Remote I/O error")
        devices = [device for own, device in self.devices.items() if device.answers_to(own, address)]
        if not devices:
            raise OSError(121, "Remote I/O error")
        return devices

    def write_i2c_block_data(self, address: int, register: int, data: list[int]) -> None:
        devices = self._answering(address)
        self.log.append((address, register, tuple(data)))
        for device in devices:
            device.write(register, data)

    def read_i2c_block_data(self, address: int, register: int, length: int) -> list[int]:
        answers = [device.read(register, length) for device in self._answering(address)]
        # The bus is a wired AND: two who answer at once garble each other.
        return [int.__and__(*pair) for pair in zip(answers[0], answers[-1], strict=True)]

    def close(self) -> None:
        self.closed = True
