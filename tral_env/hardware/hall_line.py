"""The hall sensor on a pin of the computer: edges with the kernel's time stamps, by the library gpiod."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from tral_env.config import HallConfig
from tral_env.errors import HardwareError, MissingExtraError
from tral_env.geometry import HALL_METRES_PER_TICK
from tral_env.hardware.actuator.options import check_quantities, quantity
from tral_env.hardware.physical import Physical
from tral_env.hardware.sensors import FrameWatcher, HallCounter, Sensors

_NS = 1_000_000_000
_STAMP_S = 1e-6
"""Resolution of the time stamps, s; the kernel's own is finer."""
_BUFFER = 1024
"""The kernel keeps so many edges: ten seconds at 2.4 m/s."""


@dataclass(frozen=True, kw_only=True)
class HallOptions:
    """A hall sensor on a pin of the computer."""

    line: int = quantity(17, 0, 1023)
    """Number of the pin's line on its chip; on a Raspberry Pi the number of the GPIO."""
    chip: str = "/dev/gpiochip0"
    """Device file of the chip; `gpiodetect` lists them."""
    pull: Literal["up", "down", "none"] = "up"
    """Resistor of the computer at the pin; a sensor with an open collector wants "up"."""
    active: Literal["low", "high"] = "low"
    """Level of the pin while a magnet is near."""
    metres_per_tick: float = quantity(HALL_METRES_PER_TICK, 0.001, 0.5, "m")
    """Travel of the wheel from magnet to magnet, m."""
    debounce_s: float = quantity(0.001, 0.0, 0.02, "s")
    """An edge counts only if the pin was quiet for this long before it, s."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_quantities(self)

    def open(self, clock: Callable[[], float], sleep: Callable[[float], None]) -> Sensors:
        """Ask the kernel for the pin; see `tral_env.hardware.sensor_drivers.SensorOptions.open`."""
        del sleep
        return HallLine(self, clock)


class HallLine(Physical):
    """Distance and speed from a pin, as `Sensors`.

    The environment's clock has to be `time.monotonic`, which stamps the edges too.
    """

    provided_readings = HallCounter.provided_readings

    def __init__(self, options: HallOptions, clock: Callable[[], float] = time.monotonic) -> None:
        """Ask the kernel for the pin.

        Raises:
            MissingExtraError: gpiod is not installed.
            HardwareError: there is no such pin, or another program has it.
        """
        self._options = options
        self._counter = HallCounter(HallConfig(metres_per_tick=options.metres_per_tick, stamp_s=_STAMP_S), clock)
        self._last_s = -float("inf")
        self._rising: Any = None
        self._watcher: FrameWatcher | None = None
        self._request: Any = self._asked()

    def watch_frames(self, watcher: FrameWatcher) -> None:
        """Call a watcher for each change of the pin, also one that does not count.

        A frame of "hall" has nine bytes: 1 for a magnet that comes near, 0 for one that goes, then the kernel's stamp,
        ns, low byte first.
        """
        self._watcher = watcher

    def start(self) -> None:
        """Count from zero; edges that the kernel kept are forgotten."""
        self._drain()
        self._counter.start()

    def read(self, now: float) -> Mapping[str, float]:
        """Give distance and speed at a time; see `Sensors.read`."""
        self._drain()
        return self._counter.read(now)

    def stop(self) -> None:
        """Give the pin back."""
        if self._request is not None:
            self._request.release()
            self._request = None

    def _asked(self) -> Any:
        try:
            import gpiod
            from gpiod.line import Bias, Edge
        except ImportError as error:
            raise MissingExtraError("gpiod", "car", "the hall sensor of the car") from error
        self._rising = gpiod.EdgeEvent.Type.RISING_EDGE
        options = self._options
        bias = {"up": Bias.PULL_UP, "down": Bias.PULL_DOWN, "none": Bias.DISABLED}[options.pull]
        pin = gpiod.LineSettings(edge_detection=Edge.BOTH, bias=bias, active_low=options.active == "low")
        try:
            return gpiod.request_lines(
                options.chip, {options.line: pin}, consumer="tral-hall", event_buffer_size=_BUFFER
            )
        except (OSError, ValueError) as error:
            raise HardwareError(
                f"cannot use line {options.line} of {options.chip} ({error}). `gpioinfo` lists the lines and their "
                "users; add the user to the group gpio"
            ) from error

    def _drain(self) -> None:
        """Count the edges that the kernel kept: a magnet that came near after the pin was quiet."""
        while self._request.wait_edge_events(0):
            for event in self._request.read_edge_events():
                stamp_s = event.timestamp_ns / _NS
                was_quiet = stamp_s - self._last_s >= self._options.debounce_s
                self._last_s = stamp_s
                if self._watcher is not None:
                    comes = event.event_type is self._rising
                    self._watcher("hall", bytes([comes]) + event.timestamp_ns.to_bytes(8, "little"))
                if was_quiet and event.event_type is self._rising:
                    self._counter.edge(stamp_s)
