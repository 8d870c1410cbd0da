"""Steps that ask the sensors: hall sensor, ultrasonics, camera and lens."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from tral_env.calibration.camera_info import LENSES
from tral_env.errors import CalibrationError, ConfigError, HardwareError
from tral_env.geometry import WHEEL_RADIUS_M
from tral_env.hardware.bringup.adjust import asked_number
from tral_env.hardware.bringup.steps import Found, Guided, Step
from tral_env.hardware.car_file import Sensor
from tral_env.hardware.sensors import Sensors
from tral_env.interface import CONTROL_PERIOD_S

_TURNS = 10
_TURN_S, _REST_S = 40.0, 3.0
"""The wheel is watched for so long at most, and no longer than this after it came to rest."""
_HAND_S, _SETTLE_S = 15.0, 0.5
"""A hand is waited for so long; the ranges are read for so long before, and while it is there."""
_HAND_M = (0.05, 0.5)
"""A hand before an ultrasonic is this far away."""
_SIDES = ("left", "front", "right")
_CAMERA_S = 2.0


def hall(guided: Guided) -> Found:
    """Turn the wheel ten times by hand: so many edges are so much way."""
    person = guided.person
    number, sensor = _with(guided, "hall", "board2016", "ucboard")
    usual = round(2e3 * math.pi * WHEEL_RADIUS_M)
    circumference = asked_number(person, "Circumference of the wheel (2 pi times its radius)", usual, 50, 1000, "mm")
    while True:
        person.ask(
            f"Within {_TURN_S:g} s, turn the wheel of the sensor {_TURNS} times by hand, then let it rest. Enter [q]"
        )
        with _open(guided, sensor) as sensors:
            told = _watched(guided, sensors)
        if told == 0.0:
            person.say(
                "  no edge came: check the sensor's supply and its pin, the pull, and the distance of the magnets"
            )
            continue
        metres = _TURNS * circumference / 1000
        person.say(f"  the sensor told {told:.3f} m, the wheel went {metres:.3f} m")
        if person.agrees(f"Correct it by {metres / told:.3f}?"):
            name, value = _unit(sensor)
            return {("sensors", number, name): _scaled(name, value, metres / told)}


def _unit(sensor: Sensor) -> tuple[str, float]:
    """The option that says how much way a count is."""
    name = "units_per_m" if sensor.driver == "board2016" else "metres_per_tick"
    return name, float(getattr(sensor.options, name))


def _scaled(name: str, value: float, factor: float) -> float:
    return round(value / factor if name == "units_per_m" else value * factor, 6)


def _watched(guided: Guided, sensors: Sensors) -> float:
    """Distance that a sensor told until the wheel came to rest, m."""
    bench = guided.bench
    begun_s, distance, moved_s = bench.clock(), 0.0, math.inf
    while (now := bench.clock()) - begun_s < _TURN_S and now - moved_s < _REST_S:
        new = sensors.read(now).get("distance", 0.0)
        if new != distance:
            distance, moved_s = new, now
        bench.sleep(CONTROL_PERIOD_S)
    return distance


def sonars(guided: Guided) -> Found:
    """Hold a hand before each ultrasonic: the right one must hear it."""
    person = guided.person
    number, sensor = _with(guided, "srf08", "srf02", "board2016", "ucboard")
    provided = _provided(guided, sensor)
    sides = [side for side in _SIDES if f"ultrasonic_{side}" in provided]
    heard: dict[str, str] = {}
    for side in sides:
        while side not in heard:
            person.ask(f"Take all hands away, press Enter, then hold a hand 0.3 m before the {side} ultrasonic [q]")
            with _open(guided, sensor) as sensors:
                answer = _first_near(guided, sensors, sides)
            if answer is None:
                person.say(f"  no ultrasonic heard a hand within {_HAND_S:g} s")
            else:
                person.say(f"  the {answer} ultrasonic heard it" + ("" if answer == side else f", not the {side} one"))
                heard[side] = answer
    if heard == {side: side for side in sides}:
        return {}
    addresses = getattr(sensor.options, "addresses", None)
    if addresses is None or sorted(heard.values()) != sorted(sides):
        raise HardwareError("the ultrasonics are mixed up: change their plugs, then repeat this step")
    person.say("  the addresses in the file are exchanged accordingly")
    return {("sensors", number, "addresses", side): addresses[heard[side]] for side in sides}


def _first_near(guided: Guided, sensors: Sensors, sides: list[str]) -> str | None:
    """The ultrasonic that hears something near that was not there before; None: none does."""
    bench, before, near_s = guided.bench, dict.fromkeys(sides, False), dict.fromkeys(sides, 0.0)
    begun_s = bench.clock()
    while (past_s := bench.clock() - begun_s) < _HAND_S:
        readings = sensors.read(bench.clock())
        for side in sides:
            is_near = _HAND_M[0] <= readings.get(f"ultrasonic_{side}", math.inf) <= _HAND_M[1]
            if past_s < _SETTLE_S:
                before[side] = before[side] or is_near
                continue
            near_s[side] = near_s[side] + CONTROL_PERIOD_S if is_near and not before[side] else 0.0
            if near_s[side] >= _SETTLE_S:
                return side
        bench.sleep(CONTROL_PERIOD_S)
    return None


def camera(guided: Guided) -> Found:
    """See that the camera gives images of the size in the file, and take its lens."""
    from tral_env.hardware.camera import open_capture, require_size

    person, options = guided.person, guided.car.camera
    assert options is not None
    capture, images = open_capture(options), 0
    begun_s = guided.bench.clock()
    try:
        while guided.bench.clock() - begun_s < _CAMERA_S:
            whole, image = capture.read()
            if whole:
                require_size(image, options)
                images += 1
            else:
                guided.bench.sleep(CONTROL_PERIOD_S)
    finally:
        capture.release()
    if not images:
        raise HardwareError(f"the camera {options.device} gave no image within {_CAMERA_S:g} s")
    person.say(f"  {images / _CAMERA_S:.0f} images a second of {options.width} x {options.height} px")
    person.say(f"Calibrate its lens, in another terminal: tral calibrate {_source(options.device)} --out runs/lens")
    while True:
        path = person.ask("Path of the lens file, such as runs/lens/camera_info.yaml [q: later]", keep_case=True)
        lens = _seen_from(guided.file.path, path)
        try:
            _tried(guided, lens)
        except (CalibrationError, ConfigError) as error:
            person.say(f"  {error}")
            continue
        return {("camera", "lens"): lens}


def _seen_from(file: Path, typed: str) -> str:
    """A path that a person typed, which begins at the folder of the terminal, as the car file has it: from its own."""
    if typed in LENSES:
        return typed
    return os.path.relpath(Path(typed).expanduser().resolve(), file.resolve().parent)


def _tried(guided: Guided, path: str) -> None:
    """Read a lens, as the car will; its path begins at the car file."""
    assert guided.car.camera is not None
    lens = path if path in LENSES else str(guided.file.path.parent / path)
    replace(guided.car.camera, lens=lens).calibrated()


def _source(device: int | str) -> str:
    return f"/dev/video{device}" if isinstance(device, int) else device


def _with(guided: Guided, *drivers: str) -> tuple[int, Sensor]:
    """The first sensor of one of some drivers, and its number."""
    return next((i, each) for i, each in enumerate(guided.car.sensors) if each.driver in drivers)


def _provided(guided: Guided, sensor: Sensor) -> frozenset[str]:
    with _open(guided, sensor) as sensors:
        return getattr(sensors, "provided_readings", frozenset())


@contextmanager
def _open(guided: Guided, sensor: Sensor) -> Iterator[Sensors]:
    """A sensor, open and started. The board is set up before: some send measurements only then, and a PCA9685 that is
    not set up answers to the address of the first ultrasonic.
    """
    with guided.bench.open(guided.car):
        sensors = sensor.options.open(guided.bench.clock, guided.bench.sleep)
        try:
            sensors.start()
            yield sensors
        finally:
            with suppress(OSError):
                sensors.stop()


SENSOR_STEPS = (
    Step(name="hall", title="Hall sensor", moves=True, run=hall),
    Step(name="sonars", title="Ultrasonics", moves=True, run=sonars),
    Step(name="camera", title="Camera and lens", moves=False, run=camera),
)
