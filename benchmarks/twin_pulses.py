"""Pulses of the twin's PWM board: what Adafruit's library and the car's own driver ask for, and what leaves the pin.

    python benchmarks/twin_pulses.py --out runs/twin_pulses.json

At each frequency both set pulses of 500 to 2500 us in steps of half a microsecond. The registers that each writes are
read back, and the board's model makes pulses of them with a clock of 26.3 MHz, which both were told; the last column is
the error of a library that takes the clock for 25 MHz.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import adafruit_pca9685
import numpy as np

from tral_env.hardware.actuator.laws import Channel
from tral_env.hardware.actuator.pca9685 import Board
from tral_env.hardware.i2c import Bus
from tral_env.twin.bus import I2cBus, I2cMessage, TwinSmbus
from tral_env.twin.pca9685 import Pca9685Chip
from tral_fsm.evaluation.host import host

FREQUENCIES_HZ = (50.0, 57.4, 60.0, 100.0)
CLOCK_HZ = 26_300_000
WANTED_US = np.arange(500.0, 2500.5, 0.5)


class BusIO:
    """The part of ``busio.I2C`` that Adafruit's library uses."""

    def __init__(self, bus: I2cBus) -> None:
        self._bus = bus

    def try_lock(self) -> bool:
        """Always."""
        return True

    def unlock(self) -> None:
        """Nothing to do."""

    def writeto(self, address: int, buffer: Any, *, start: int = 0, end: int | None = None, **_: Any) -> None:
        """Write."""
        self._bus.transfer([I2cMessage(address, bytes(buffer)[start:end])])

    def writeto_then_readfrom(self, address: int, out: Any, into: Any, **places: Any) -> None:
        """Write, then read."""
        first, last = places.get("in_start", 0), places.get("in_end") or len(into)
        read = I2cMessage(address, length=last - first, reads=True)
        data = bytes(out)[places.get("out_start", 0) : places.get("out_end")]
        into[first:last] = self._bus.transfer([I2cMessage(address, data), read])[0]


def at(hz: float) -> dict[str, Any]:
    """Errors at one frequency."""
    chip = Pca9685Chip(CLOCK_HZ)
    bus = I2cBus([chip])
    library = adafruit_pca9685.PCA9685(BusIO(bus), reference_clock_speed=CLOCK_HZ)
    library.frequency = hz
    theirs_divider = TwinSmbus(bus).read_byte_data(0x40, 0xFE)
    library_us = _sweep(chip, bus, lambda us: _duty(library, us))
    channels = [Channel(output, 499.0, 1500.0, 2501.0, 0.0, 495.0, 2505.0, 0.0) for output in (0, 1)]
    device = Bus(TwinSmbus(bus)).device(0x40, "board")
    board = Board(
        device, period_us=1e6 / hz, oscillator_hz=CLOCK_HZ, steering=channels[0], throttle=channels[1]
    )  # fmt: skip
    board.start()
    car_us = _sweep(chip, bus, lambda us: board.set_pulses(us, us))
    return {
        "hz": hz,
        "dividers_equal": theirs_divider == TwinSmbus(bus).read_byte_data(0x40, 0xFE),
        "step_us": chip.step_us,
        "library_max_error_us": float(np.abs(library_us - WANTED_US).max()),
        "car_max_error_us": float(np.abs(car_us - WANTED_US).max()),
        "steps_apart": float((np.abs(car_us - library_us) / chip.step_us).max()),
        "wrong_clock_max_error_us": float(np.abs(library_us * 25e6 / CLOCK_HZ - WANTED_US).max()),
    }


def _duty(library: Any, us: float) -> None:
    library.channels[0].duty_cycle = round(us * library.frequency * 65536e-6)


def _sweep(chip: Pca9685Chip, bus: I2cBus, send: Any) -> np.ndarray:
    """Pulses for all wanted ones; registers that are read back must make the same pulse."""
    time.sleep(0.001)  # the outputs wake up
    found = []
    for us in WANTED_US.tolist():
        send(us)
        on_low, on_high, off_low, off_high = TwinSmbus(bus).read_i2c_block_data(0x40, 0x06, 4)
        pulse_us = chip.pulse_us(0)
        steps = (off_high << 8 | off_low) - (on_high << 8 | on_low)
        assert abs(pulse_us - steps * chip.step_us) < 1e-9
        found.append(pulse_us)
    return np.array(found)


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    rows = [at(hz) for hz in FREQUENCIES_HZ]
    for row in rows:
        print(json.dumps(row))
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text(json.dumps({"host": host(), "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
