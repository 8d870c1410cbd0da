"""Before a drive: is each sensor live, and is the battery full enough?"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from tral_env.hardware.sensors import Sensors, provided_by

LISTEN_S = 0.5
"""Each sensor has so long to give its first reading, s: four rangings of the slowest ultrasonic."""
_PAUSE_S = 0.01
_SEEN = ("gate_", "marker_")
"""Readings that come only when there is something to see."""


def preflight(
    sensors: Sensors | None, battery_stop_v: float, clock: Callable[[], float], sleep: Callable[[float], None]
) -> list[str]:
    """Listen to the sensors of a car that stands, in neutral and not armed: what is wrong, a line each.

    Args:
        sensors: those of the car; None: it has none.
        battery_stop_v: a battery below this voltage is empty, V.
        clock: clock of the sensors, s.
        sleep: waits some seconds.

    Raises:
        HardwareError: a device does not answer.
    """
    if sensors is None:
        return []
    sensors.start()
    readings: Mapping[str, float] = {}
    until_s = clock() + LISTEN_S
    while clock() < until_s:
        readings = sensors.read(clock())
        sleep(_PAUSE_S)
    wanted = provided_by(sensors) or frozenset()
    missing = sorted(name for name in wanted if name not in readings and not name.startswith(_SEEN))
    problems = [f"no reading of {', '.join(missing)} within {LISTEN_S:g} s"] if missing else []
    if 0.0 < readings.get("battery", 0.0) < battery_stop_v:
        problems.append(f"the battery has {readings['battery']:.1f} V, below {battery_stop_v:g} V")
    return problems
