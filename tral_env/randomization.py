"""How much the cars differ: named levels, and the draw of one car.

| level | meant for |
| --- | --- |
| none | the nominal car: unit tests, system identification, first steps |
| default | cars as they are: what a policy must cope with |
| hard | the worst cars that a policy may meet |

A level of one's own is a `Randomization`, or a file that `read_level` reads.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env import json_text, yaml_text
from tral_env.checks import Bounds, as_config, check_number, check_plausible, one_of
from tral_env.config import EscConfig, UltrasonicConfig
from tral_env.errors import BadFileError, ConfigError, nearest, problem_report

Range = tuple[float, float]
_ESC, _SONAR = EscConfig(), UltrasonicConfig()

_FACTORS = ("lock_scale", "servo_speed_scale", "servo_strength_scale", "mass_scale", "wheel_radius_scale")
_ABOVE_0 = {*_FACTORS, "friction", "battery_v", "sonar_cadence_s"}
_FROM_0 = {"latency_s", "camera_latency_s", "battery_resistance_ohm", "image_degradation"}
_SHARES = {"sonar_together", "sonar_outlier_rate", "hall_miss_rate", "hall_double_rate", "false_sighting_rate"}
_PLAUSIBLE: Bounds = {
    **dict.fromkeys(("mechanism_offset_deg", "steering_offset_deg"), (-45.0, 45.0, "deg")),
    **dict.fromkeys(_FACTORS, (0.05, 20.0, "")),
    "friction": (0.01, 5.0, ""),
    "battery_v": (1.0, 60.0, "V"),
    "battery_resistance_ohm": (0.0, 10.0, "ohm"),
    "sonar_cadence_s": (0.001, 5.0, "s"),
    "latency_s": (0.0, _ESC.max_latency_s, "s"),
    "camera_latency_s": (0.0, 5.0, "s"),
    "image_degradation": (0.0, 10.0, ""),
    **dict.fromkeys(("camera_roll_deg", "camera_pitch_deg", "camera_yaw_deg"), (-180.0, 180.0, "deg")),
}


@dataclass(frozen=True, kw_only=True)
class Randomization:
    """Range of each parameter of a car; each is drawn uniformly and on its own."""

    mechanism_offset_deg: Range = (0.0, 0.0)
    """Offset of the steering linkage; it shifts the travel that the servo has, deg. Source: Apollo_13 measured +6."""
    steering_offset_deg: Range = (0.0, 0.0)
    """What calibration has left of that offset: steering angle at command 0, deg. Source: choice."""
    lock_scale: Range = (1.0, 1.0)
    """Factor on the steering angle at full command. Source: choice."""
    servo_speed_scale: Range = (1.0, 1.0)
    """Factor on the servo's speed. Source: choice."""
    servo_strength_scale: Range = (1.0, 1.0)
    """Factor on the servo's stall torque. Source: choice."""
    latency_s: Range = (_ESC.nominal_latency_s, _ESC.nominal_latency_s)
    """From command to pulse, s. Source: choice."""
    friction: Range = (0.9, 0.9)
    """Coefficient of friction of the tyres. Source: rubber on linoleum, 0.7 to 1.1."""
    mass_scale: Range = (1.0, 1.0)
    """Factor on the car's mass. Source: choice."""
    wheel_radius_scale: Range = (1.0, 1.0)
    """True wheel radius over the one that the hall sensor relies on; above 1 its distance is short. Source: choice."""
    battery_v: Range = (_ESC.battery_v, _ESC.battery_v)
    """Open-circuit voltage, V. Source: six NiMH cells, 6.4 to 8.4 V."""
    battery_resistance_ohm: Range = (0.0, 0.0)
    """Internal resistance: the voltage sags under load, ohm. Source: six NiMH cells with leads, about 0.1."""
    sonar_cadence_s: Range = (_SONAR.cadence_s, _SONAR.cadence_s)
    """Time from one ranging to the next, s. Source: SRF08, 65 ms."""
    sonar_together: Range = (0.0, 0.0)
    """Above 0.5: the three sonars fire together and hear each other; else they fire apart. Source: choice."""
    sonar_outlier_rate: Range = (0.0, 0.0)
    """Share of readings that are nonsense. Source: report ("many outliers")."""
    hall_miss_rate: Range = (0.0, 0.0)
    """Share of hall ticks that are missed. Source: report ("very unreliable")."""
    hall_double_rate: Range = (0.0, 0.0)
    """Share of hall ticks that count twice. Source: report."""
    camera_latency_s: Range = (0.03, 0.03)
    """From exposure to detection, s. Source: webcams of the era."""
    camera_roll_deg: Range = (0.0, 0.0)
    """Mounting error of the camera about x, forward, deg. Source: choice."""
    camera_pitch_deg: Range = (0.0, 0.0)
    """Mounting error of the camera about y, + looks down, deg. Source: choice."""
    camera_yaw_deg: Range = (0.0, 0.0)
    """Mounting error of the camera about z, + looks left, deg. Source: choice."""
    image_degradation: Range = (0.0, 0.0)
    """Noise, blur and wrong exposure of the camera image: 0 none, 1 mild, 3 strong, 10 at most. Source: choice."""

    false_sighting_rate: Range = (0.0, 0.0)
    """Share of images that show a marker where there is none. Source: choice around 0.007, see docs/perception.md."""

    hard_courses: bool = False
    """Whether courses are harder too: gates may stand directly behind a corner, or where one wall is missing."""

    def __post_init__(self) -> None:
        for name in PARAMETERS:
            _check_range(name, getattr(self, name))
        _check_flag(self.hard_courses)

    def draw(self, rng: np.random.Generator) -> dict[str, float]:
        """Draw one car: parameter -> value. Each parameter takes one number of the generator, whatever its range."""
        low, span = self._ends
        return dict(zip(PARAMETERS, (low + span * rng.random(len(PARAMETERS))).tolist(), strict=True))

    @cached_property
    def _ends(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lower ends and widths of the ranges."""
        low, high = np.array([getattr(self, name) for name in PARAMETERS], float).T
        return low, high - low

    def fixed(self, **values: float) -> Randomization:
        """The same ranges with some parameters fixed.

        Raises:
            ConfigError: unknown parameter.
        """
        for name in values:
            if name not in PARAMETERS:
                raise ConfigError(f"unknown parameter '{name}': {nearest(name, PARAMETERS)}")
        ranges: dict[str, Any] = {name: (value, value) for name, value in values.items()}
        return replace(self, **ranges)


PARAMETERS = tuple(field.name for field in fields(Randomization) if field.name != "hard_courses")
"""Names of the parameters of a car, in the order in which they are drawn."""


def _check_flag(hard_courses: Any) -> None:
    if not isinstance(hard_courses, bool):
        raise ConfigError(f"Randomization.hard_courses = {hard_courses!r}. Allowed: True, False")


def _check_range(name: str, pair: Any) -> None:
    got = f"Randomization.{name} = {pair!r}: expected"
    if isinstance(pair, str) or not isinstance(pair, Iterable) or len(ends := tuple(pair)) != 2:
        raise ConfigError(f"{got} two numbers: low, high")
    bounds = _PLAUSIBLE.get(name)
    for end in ends:
        check_number(f"Randomization.{name}", end, bounds[2] if bounds else "")
    low, high = (float(end) for end in ends)
    if low > high:
        raise ConfigError(f"{got} (low, high), low <= high")
    if (name in _ABOVE_0 and low <= 0) or (name in _FROM_0 and low < 0):
        raise ConfigError(f"{got} numbers {'above' if name in _ABOVE_0 else 'from'} 0")
    if name in _SHARES and not 0 <= low <= high <= 1:
        in_percent = "; is it in %?" if low >= 0 and 1 < high <= 100 else ""
        raise ConfigError(f"{got} shares between 0 and 1{in_percent}")
    if bounds:
        for end in (low, high):
            check_plausible(f"Randomization.{name}", end, *bounds)


LEVELS: Mapping[str, Randomization] = {
    "none": Randomization(),
    "default": Randomization(
        mechanism_offset_deg=(-6.0, 6.0),
        steering_offset_deg=(-1.0, 1.0),
        lock_scale=(0.95, 1.05),
        servo_speed_scale=(0.8, 1.2),
        servo_strength_scale=(0.8, 1.2),
        latency_s=(0.010, 0.040),
        friction=(0.7, 1.1),
        mass_scale=(0.9, 1.1),
        wheel_radius_scale=(0.99, 1.01),
        battery_v=(6.8, 8.2),
        sonar_cadence_s=(0.065, 0.075),
        sonar_outlier_rate=(0.005, 0.005),
        hall_miss_rate=(0.01, 0.01),
        hall_double_rate=(0.01, 0.01),
        camera_latency_s=(0.020, 0.060),
        camera_roll_deg=(-1.0, 1.0),
        camera_pitch_deg=(-1.0, 1.0),
        camera_yaw_deg=(-1.0, 1.0),
        image_degradation=(0.5, 1.5),
        false_sighting_rate=(0.002, 0.002),
    ),
    "hard": Randomization(
        mechanism_offset_deg=(-8.0, 8.0),
        steering_offset_deg=(-2.5, 2.5),
        lock_scale=(0.88, 1.12),
        servo_speed_scale=(0.6, 1.4),
        servo_strength_scale=(0.6, 1.4),
        latency_s=(0.010, 0.080),
        friction=(0.5, 1.2),
        mass_scale=(0.8, 1.2),
        wheel_radius_scale=(0.97, 1.03),
        battery_v=(6.4, 8.4),
        battery_resistance_ohm=(0.05, 0.15),
        sonar_cadence_s=(0.065, 0.110),
        sonar_together=(0.0, 1.0),
        sonar_outlier_rate=(0.03, 0.03),
        hall_miss_rate=(0.05, 0.05),
        hall_double_rate=(0.05, 0.05),
        camera_latency_s=(0.020, 0.120),
        camera_roll_deg=(-2.5, 2.5),
        camera_pitch_deg=(-2.5, 2.5),
        camera_yaw_deg=(-2.5, 2.5),
        image_degradation=(1.0, 3.0),
        false_sighting_rate=(0.02, 0.02),
        hard_courses=True,
    ),
}
"""The named levels; docs/randomization.md has them as a table."""


def level(randomization: str | Path | Randomization | Mapping[str, Any]) -> Randomization:
    """Find a level by its name or its file, or take over ranges.

    Args:
        randomization: name of a level; path of a file, see `read_level`; ranges; a mapping of ranges, which is what the
            JSON of an environment's spec holds.

    Raises:
        ConfigError: unknown name, or the ranges or the file are not allowed.
    """
    if isinstance(randomization, Randomization | Mapping):
        return as_config(Randomization, randomization)
    if str(randomization).lower().endswith(_SUFFIXES):
        return read_level(randomization)
    one_of("randomization", randomization, LEVELS, f"; a file has to end in {', '.join(_SUFFIXES)}")
    return LEVELS[str(randomization)]


_SUFFIXES = (".json", ".yaml", ".yml")


def read_level(path: str | Path) -> Randomization:
    """Read a level of one's own from a file.

    Args:
        path: a JSON or YAML file: parameter -> low and high, or one number; `hard_courses` -> true or false. `base`
            names the level that the others are taken from; without it they are those of the nominal car, "none".

    Raises:
        ConfigError: the file cannot be read.
        BadFileError: something in it is not allowed; the message lists all problems.
    """
    content = _content(path)
    base = content.pop("base", "none")
    names = [field.name for field in fields(Randomization)]
    problems: list[str] = []
    values: dict[str, Any] = {}
    if not isinstance(base, str) or base not in LEVELS:
        problems.append(f"base: got {base!r}: {nearest(base, LEVELS)}")
    for name, given in content.items():
        if name not in names:
            problems.append(f"unknown parameter '{name}': {nearest(name, ['base', *names])}")
            continue
        try:
            values[name] = _value_in_file(name, given)
        except ConfigError as error:
            problems.append(str(error).removeprefix("Randomization."))
    if problems:
        raise BadFileError(problem_report(str(path), problems))
    return replace(LEVELS[base], **values)


def _value_in_file(name: str, given: Any) -> bool | Range:
    """What a file gives for a field: low and high, one number for both, or a flag."""
    if name == "hard_courses":
        _check_flag(given)
        return bool(given)
    low, high = given if isinstance(given, list) and len(given) == 2 else (given, given)
    _check_range(name, given if isinstance(given, list) else (low, high))
    return float(low), float(high)


def _content(path: str | Path) -> dict[str, Any]:
    """The mapping in a JSON or YAML file."""
    try:
        text = json_text.read(path)
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"randomization {path}: cannot be read: {json_text.unread(error)}") from error
    is_json = str(path).lower().endswith(".json")
    content = json_text.loads(text, str(path), BadFileError) if is_json else _yaml(text, path)
    if not isinstance(content, dict) or not content:
        got = "list" if isinstance(content, list) else type(content).__name__
        raise BadFileError(f"{path}: got {got}: expected parameters and their ranges, such as friction: [0.4, 0.6]")
    return content


def _yaml(text: str, path: str | Path) -> Any:
    found = yaml_text.documents(text, str(path), BadFileError)
    if len(found) > 1:
        raise BadFileError(f"{path}: got {len(found)} documents between lines of '---': expected one")
    content = found[0] if found else None
    return {name: _numbers(given) for name, given in content.items()} if isinstance(content, dict) else content


def _numbers(given: Any) -> Any:
    return [yaml_text.number(each) for each in given] if isinstance(given, list) else yaml_text.number(given)
