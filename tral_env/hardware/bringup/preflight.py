"""The check before a drive: calibration, board, every sensor, battery."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

from tral_env.errors import TralError
from tral_env.hardware.actuator.client import ActuatorProcess
from tral_env.hardware.actuator.settings import Settings
from tral_env.hardware.bringup.steps import missing_steps
from tral_env.hardware.car_file import CarFile
from tral_env.hardware.commands import Actuator
from tral_env.hardware.opening import Device, devices
from tral_env.hardware.sensors import image_times, provided_by
from tral_env.interface import CONTROL_PERIOD_S, NO_ECHO_M

_LISTEN_S = 1.0
"""Each sensor has so long to give its first readings: fifteen rangings, or a second of a slow camera."""
_SEEN = ("gate_", "marker_")
"""Readings that come only when there is something to see."""
_NO_BATTERY_V = 0.5
"""A lower voltage means that no battery is connected to the sensor."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What was looked at, and what is wrong with it."""

    what: str
    problem: str = ""
    """Empty: nothing is wrong."""
    told: str = ""
    """What is worth knowing although nothing is wrong."""


def check_car(
    car: CarFile,
    start: Callable[[Settings], Actuator] = ActuatorProcess,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> list[Finding]:
    """Look at all that a drive needs. The board is opened in neutral, unless its clock was never measured.

    Args:
        car: the car.
        start: starts the actuator's process.
        clock: gives a time that never goes back, s.
        sleep: waits some seconds.
    """
    missing = missing_steps(car)
    findings = [
        Finding(
            what="calibration",
            problem=f"missing: {', '.join(missing)}; run `tral car calibrate`" if missing else "",
        )
    ]
    if not car.clock_is_known:
        unknown = (
            "its clock was never measured, so its neutral may drive the motor: it stays off, and so do the sensors"
        )
        return [*findings, Finding(what=f"board {car.board.driver}", problem=unknown)]
    try:
        actuator = start(replace(car.settings, limits=replace(car.limits, evidence_s=None)))
    except TralError as error:
        return [*findings, Finding(what=f"board {car.board.driver}", problem=str(error))]
    try:
        findings.append(Finding(what=f"board {car.board.driver}", told=_granted(actuator)))
        findings += _sensors(car, clock, sleep)
    finally:
        with suppress(TralError):
            actuator.close()
    return findings


def _granted(actuator: Actuator) -> str:
    """What the system granted the actuator's process."""
    hello: Mapping[str, object] = getattr(actuator, "hello", {})
    refused = [what for what in ("realtime", "locked") if not hello.get(what, True)]
    return f"without {' and '.join(refused)}, see docs/safety.md" if refused else ""


def _sensors(car: CarFile, clock: Callable[[], float], sleep: Callable[[float], None]) -> Iterator[Finding]:
    if not car.sensors:
        yield Finding(what="sensors", told='none: every reading is "nothing seen"')
    for device in devices(car, clock, sleep):
        yield from _live(device, car, clock, sleep)


def _live(
    device: Device, car: CarFile, clock: Callable[[], float], sleep: Callable[[float], None]
) -> Iterator[Finding]:
    """Open a sensor, listen to it, and tell what does not come."""
    name, readings = device.name, dict[str, float]()
    try:
        sensors = device.open()
    except TralError as error:
        yield Finding(what=name, problem=str(error))
        return
    try:
        sensors.start()
        begun_s, before = clock(), image_times(sensors)
        while clock() - begun_s < _LISTEN_S:
            readings = dict(sensors.read(clock()))
            sleep(CONTROL_PERIOD_S)
        is_blind = before is not None and image_times(sensors) == before
    except TralError as error:
        yield Finding(what=name, problem=str(error))
        return
    finally:
        with suppress(OSError):
            sensors.stop()
    wanted = provided_by(sensors) or frozenset()
    silent = sorted(each for each in wanted if each not in readings and not each.startswith(_SEEN))
    silent += ["image"] * is_blind
    yield Finding(
        what=name, problem=f"no {', '.join(silent)} within {_LISTEN_S:g} s" if silent else "", told=_told(readings)
    )
    if "battery" in readings:
        yield _battery(readings["battery"], car)


def _told(readings: Mapping[str, float]) -> str:
    """The ranges, which a person can compare with the room, and what cannot be seen on a car that stands."""
    told = [
        f"{side} {_range(readings[f'ultrasonic_{side}'])}"
        for side in ("left", "front", "right")
        if f"ultrasonic_{side}" in readings
    ]
    if readings.get("distance") == 0.0:
        told.append("the wheel stands, so a hall wire that is off would not be noticed: turn it, see the step hall")
    return ", ".join(told)


def _range(metres: float) -> str:
    return f"{metres:.2f} m" if metres < NO_ECHO_M else "no echo: hold a hand before it"


def _battery(volts: float, car: CarFile) -> Finding:
    told, limits = f"{volts:.2f} V", car.battery
    if volts < _NO_BATTERY_V:
        return Finding(what="battery", problem=f"{told}: is it connected?")
    if volts < limits.stop_v:
        return Finding(what="battery", problem=f"{told} is below stop_v = {limits.stop_v:g} V: charge it")
    return Finding(
        what="battery", told=f"{told} is below warn_v = {limits.warn_v:g} V" if volts < limits.warn_v else told
    )
