"""The one interface of cars and policies: what a policy is told (readings) and what it answers (a command).

The simulated car, the real car and every policy meet here and nowhere else. Frame: x forward, y left, z up, angles
counter-clockwise (REP 103), origin on the ground below the middle of the rear axle. SI units.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from tral_env.arrays import number
from tral_env.errors import ConfigError, nearest

FloatArray = NDArray[np.floating]

CONTROL_RATE_HZ = 80.0
"""Commands per second. Source: PID_S = 0.0125 s of the 2016 controllers."""
CONTROL_PERIOD_S = 1.0 / CONTROL_RATE_HZ
"""Time from one command to the next."""

MAX_AGE_S = 10.0
"""A reading of this age or older, or one that never came, has this age."""
NO_ECHO_M = 6.0
"""What an ultrasonic reads when no echo came back: more than any range it can measure (5 m)."""
MAX_DISTANCE_M = 100e3
"""The odometer stops here; float32 resolves 8 mm there, a third of a hall tick, and 0.1 mm at 1 km."""
NOTHING_SEEN_ID = -1.0
"""Id of a gate or marker when none has been seen yet."""

GATE_MARKER_IDS = range(0, 40)
"""Gate k is the pair of markers 2k (left post) and 2k + 1 (right post), seen in driving direction."""
GATE_IDS = range(len(GATE_MARKER_IDS) // 2)
"""A gate has one of these numbers k."""
STRONG_GATES = (1, 2, 3, 10, 11, 12, 15, 16)
"""Gates whose codes are read well when blurred, and are not seen where there is no marker. Generated courses have no
others; use them first on yours. Source: `DetectionModel.weakness`, benchmarks/false_sightings.py."""
TURN_MARKER_IDS: Mapping[str, int] = {"left": 40, "right": 41, "straight": 42}
"""Markers that tell a turn at a crossing."""
DICTIONARY_SIZE = 50
"""The dictionary of the markers, DICT_4X4_50, has so many ids."""
MARKER_IDS = (*GATE_MARKER_IDS, *TURN_MARKER_IDS.values())
"""A course has no other markers: those of gates and those that tell a turn."""


@dataclass(frozen=True, kw_only=True)
class Field:
    """One number that a policy is told."""

    name: str
    unit: str
    """SI; empty for a number without a unit."""
    low: float
    """Lower bound of the observation space; a smaller value is raised to it."""
    high: float
    """Upper bound of the observation space; a larger value is lowered to it."""
    missing: float
    """Value before anything has been measured ("nothing seen")."""
    meaning: str


def _age(name: str, what: str) -> Field:
    return Field(name=name, unit="s", low=0.0, high=MAX_AGE_S, missing=MAX_AGE_S, meaning=f"age of {what}")


def _detection(prefix: str, what: str, axis: str) -> tuple[Field, ...]:
    return (
        Field(
            name=f"{prefix}_id",
            unit="",
            low=-1.0,
            high=DICTIONARY_SIZE - 1.0,
            missing=NOTHING_SEEN_ID,
            meaning=f"id of {what}; -1: none yet",
        ),
        Field(name=f"{prefix}_x", unit="m", low=-20.0, high=20.0, missing=0.0, meaning=f"position of {what}, forward"),
        Field(name=f"{prefix}_y", unit="m", low=-20.0, high=20.0, missing=0.0, meaning=f"position of {what}, left"),
        Field(name=f"{prefix}_heading", unit="rad", low=-np.pi, high=np.pi, missing=0.0, meaning=axis),
        _age(f"{prefix}_age", f"that detection: time since the image of {what} was exposed"),
    )


CORE_FIELDS: tuple[Field, ...] = (
    *(
        Field(
            name=f"ultrasonic_{side}",
            unit="m",
            low=0.0,
            high=NO_ECHO_M,
            missing=NO_ECHO_M,
            meaning=f"range of the {side} ultrasonic; {NO_ECHO_M:g}: no echo",
        )
        for side in ("left", "front", "right")
    ),
    *(
        _age(f"ultrasonic_{side}_age", f"the {side} range, since the sensor fired")
        for side in ("left", "front", "right")
    ),
    Field(
        name="distance",
        unit="m",
        low=0.0,
        high=MAX_DISTANCE_M,
        missing=0.0,
        meaning="distance travelled since reset, counted by the hall sensor, which knows no direction",
    ),
    Field(name="speed", unit="m/s", low=0.0, high=5.0, missing=0.0, meaning="speed from the hall sensor, without sign"),
    *_detection(
        "gate",
        "the middle of the nearest gate in view",
        "heading of the gate's axis: 0 = the car points straight through",
    ),
    *_detection(
        "marker",
        "the nearest single marker in view",
        "heading into the marker: 0 = the car points straight at its face",
    ),
    Field(name="steering", unit="", low=-1.0, high=1.0, missing=0.0, meaning="the last steering command, as applied"),
    Field(name="throttle", unit="", low=-1.0, high=1.0, missing=0.0, meaning="the last throttle command, as applied"),
)
"""The fields of every observation, in their order."""

OPTIONAL_GROUPS: Mapping[str, tuple[Field, ...]] = {
    "line": (
        Field(
            name="line",
            unit="",
            low=0.0,
            high=255.0,
            missing=0.0,
            meaning="one byte of the line sensor: one bit a photo diode, bit 7 leftmost, 1 = tape",
        ),
    ),
    "imu": tuple(
        Field(name=f"imu_{kind}_{axis}", unit=unit, low=-high, high=high, missing=0.0, meaning=f"{what} {axis}")
        for kind, unit, high, what in (
            ("gyro", "rad/s", 10.0, "angular rate about"),
            ("accel", "m/s^2", 40.0, "acceleration with gravity along"),
        )
        for axis in "xyz"
    ),
    "battery": (
        Field(
            name="battery", unit="V", low=0.0, high=12.0, missing=0.0, meaning="voltage of the drive battery under load"
        ),
    ),
}
"""Groups of fields that can be added behind the core fields: ``gym.make(..., groups=("imu",))``."""


def group_names(groups: Iterable[str]) -> tuple[str, ...]:
    """Names of optional groups, as a tuple.

    Raises:
        ConfigError: not names in a sequence; a single string is none.
    """
    if not isinstance(groups, str) and isinstance(groups, Iterable):
        names = tuple(groups)
        if all(isinstance(name, str) for name in names):
            return names
    raise ConfigError(f"groups = {groups!r}: expected names in a tuple, such as ('imu',)")


@dataclass(frozen=True)
class Layout:
    """Which fields an observation has, in which column."""

    fields: tuple[Field, ...] = CORE_FIELDS

    @classmethod
    def of(cls, groups: Iterable[str] = ()) -> Layout:
        """Layout of the core fields followed by the named optional groups.

        Args:
            groups: names out of `OPTIONAL_GROUPS`.

        Raises:
            ConfigError: unknown group, one given twice, or no names.
        """
        fields = list(CORE_FIELDS)
        names = group_names(groups)
        for i, group in enumerate(names):
            if group in names[:i]:
                raise ConfigError(f"observation group '{group}' is given twice")
            if group not in OPTIONAL_GROUPS:
                raise ConfigError(f"unknown observation group '{group}': {nearest(group, OPTIONAL_GROUPS)}")
            fields.extend(OPTIONAL_GROUPS[group])
        return cls(tuple(fields))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the fields, in the order of the columns."""
        return tuple(field.name for field in self.fields)

    @property
    def size(self) -> int:
        """Number of columns."""
        return len(self.fields)

    @cached_property
    def _columns(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.names)}

    def column(self, name: str) -> int:
        """Column of the field of that name.

        Raises:
            ConfigError: no such field in this layout.
        """
        if name not in self._columns:
            raise ConfigError(f"unknown reading '{name}': {nearest(name, self.names)}")
        return self._columns[name]

    @cached_property
    def _bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        low = np.array([field.low for field in self.fields], np.float32)
        high = np.array([field.high for field in self.fields], np.float32)
        return low, high

    def space(self) -> spaces.Box:
        """Observation space, Box of shape (d,), float32."""
        return spaces.Box(*self._bounds, dtype=np.float32)

    @cached_property
    def _missing(self) -> NDArray[np.float64]:
        return np.array([field.missing for field in self.fields])

    @cached_property
    def _unseen(self) -> dict[str, float]:
        return dict(zip(self.names, self._missing.tolist(), strict=True))

    def missing(self, n: int) -> NDArray[np.float64]:
        """Readings of a car that has not measured anything, shape (n, d)."""
        return np.full((n, self.size), self._missing)

    def pack(self, values: Mapping[str, FloatArray | float], n: int) -> NDArray[np.float32]:
        """Bring named readings into the order of the observation, within its bounds.

        Args:
            values: name -> (n,) or scalar; what is not named is "nothing seen".
            n: number of rows.

        Returns:
            (n, d) float32.

        Raises:
            ConfigError: a name is not a field of this layout.
        """
        columns = self._columns
        if n == 1:
            told = {**self._unseen, **values}
            if len(told) > len(columns):
                for name in values:
                    self.column(name)
            row = [value if type(value) is float else number(value) for value in told.values()]
            packed = np.array([row], np.float32)
        else:
            packed = np.full((n, self.size), self._missing, np.float32)
            for name, value in values.items():
                packed[:, columns[name] if name in columns else self.column(name)] = value
        low, high = self._bounds
        return np.minimum(np.maximum(packed, low, out=packed), high, out=packed)

    def unpack(self, observation: ArrayLike) -> dict[str, NDArray[np.floating]]:
        """Views of the named readings of an observation.

        Args:
            observation: (..., d).

        Returns:
            name -> (...).

        Raises:
            ConfigError: the last axis has not d entries.
        """
        rows: NDArray[np.floating] = np.asarray(observation)
        if rows.shape[-1:] != (self.size,):
            raise ConfigError(
                f"observation has shape {rows.shape}, expected (..., {self.size}): {', '.join(self.names)}"
            )
        return {name: rows[..., i] for i, name in enumerate(self.names)}

    def table(self) -> str:
        """Markdown table of the fields, for docstrings and docs."""
        rows = [
            f"| {i} | `{f.name}` | {f.unit or '-'} | {f.low:g} .. {f.high:g} | {f.missing:g} | {f.meaning} |"
            for i, f in enumerate(self.fields)
        ]
        return "\n".join(
            ["| # | field | unit | range | nothing seen | meaning |", "| --- | --- | --- | --- | --- | --- |", *rows]
        )


CORE_LAYOUT = Layout()
"""The layout without optional groups."""
_ALL_LAYOUT = Layout.of(OPTIONAL_GROUPS)

STEERING = 0
"""An action has the steering in this column."""
THROTTLE = 1
"""An action has the throttle in this column."""


def action_space() -> spaces.Box:
    """Space of a command: steering in [-1, 1], +1 = full left; throttle in [-1, 1], +1 = full forward, 0 = neutral."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def as_command(action: object, n: int | None = None) -> NDArray[np.float64]:
    """The command that an action is: numbers of the right shape.

    Args:
        action: (2,) steering, throttle; with `n` (n, 2).
        n: number of cars; None: one car on its own.

    Raises:
        ConfigError: text, a bool, another shape, or a number that is not finite.
    """
    shape = (2,) if n is None else (n, 2)
    try:
        numbers = np.asarray(action)
    except (TypeError, ValueError):  # rows of several lengths
        numbers = np.empty(0, object)
    if numbers.dtype.kind not in "fiu" or numbers.shape != shape or not _all_finite(numbers):
        if n is None:
            raise ConfigError(f"action {str(action)[:200]!r}: expected two finite numbers: steering, throttle")
        raise ConfigError(f"actions of {numbers.dtype} {numbers.shape}: expected ({n}, 2) finite numbers")
    return numbers.astype(np.float64)


def _all_finite(numbers: NDArray[Any]) -> bool:
    # Of two numbers Python knows it at a tenth of the cost.
    return all(map(math.isfinite, numbers.tolist())) if numbers.ndim == 1 else bool(np.isfinite(numbers).all())


class Policy(Protocol):
    """Anything that drives: a state machine, a trained network, a person with a controller."""

    def reset(self, n: int = 1) -> None:
        """Forget all drives, and start anew with n cars."""

    def act(self, observation: NDArray[np.floating]) -> NDArray[np.float32]:
        """Command for each car.

        Args:
            observation: (d,) or (n, d), the columns of `Layout`.

        Returns:
            (2,) or (n, 2): steering, throttle.
        """
        ...


def check_readings(policy: Policy, env: Any) -> None:
    """Refuse a policy that cannot drive its car: a reading is missing, or a step is no tick. Call it before a reset.

    A policy that names its readings takes them as the car measures them, and answers a throttle in each tick; so it
    cannot drive where the options of a learner, such as `decision_hz`, change what a step takes and gives.

    Args:
        policy: says what it needs in `needed_readings`, names of fields; one that does not is not checked.
        env: says what it has in `provided_readings`, and how it differs from the plain car in `learner_options`, also
            below wrappers; what one does not say is not checked.

    Raises:
        ConfigError: a needed reading is missing or unknown, the env has such options, or the needed are no names.
    """
    needed = getattr(policy, "needed_readings", None)
    if needed is None:
        return
    names = _reading_names(needed)
    below = getattr(env, "unwrapped", env)
    _require_plain(getattr(below, "learner_options", {}))
    provided = getattr(below, "provided_readings", None)
    if provided is None:
        return
    lacking = names - set(provided)
    for name in sorted(lacking.difference(_ALL_LAYOUT.names)):
        _ALL_LAYOUT.column(name)  # it raises an error that tells the nearest name
    core = [field.name for field in CORE_FIELDS if field.name in lacking]
    missing = [*core, *sorted(lacking.difference(core))]
    if missing:
        has = [name for name in provided if not name.endswith("_age") and name not in ("steering", "throttle")]
        raise ConfigError(
            f"the policy needs {', '.join(missing)}, which this car does not read; it reads "
            f"{', '.join(sorted(has)) or 'nothing'}: add the sensor (sensors=SensorGroup(...)), or choose a machine "
            "that does without, such as one with a throttle instead of a speed where the hall sensor is missing"
        )


def _reading_names(needed: object) -> set[str]:
    """The readings that a policy needs, if these are names of some."""
    names = None if isinstance(needed, str) or not isinstance(needed, Iterable) else list(needed)
    if names is None or not all(isinstance(name, str) for name in names):
        raise ConfigError(f"needed_readings = {needed!r}: expected names in a set, such as {{'distance', 'speed'}}")
    return set(names)


def _require_plain(options: Mapping[str, object]) -> None:
    """Refuse an env whose step takes or gives something else than a tick of the car does."""
    if options:
        given = ", ".join(f"{name}={value!r}" for name, value in options.items())
        raise ConfigError(
            f"the environment was made with {given}, but the policy takes the plain readings and answers steering and "
            f"throttle {CONTROL_RATE_HZ:g} times a second, as each that names `needed_readings`: make the environment "
            f"without {'it' if len(options) == 1 else 'these options'}"
        )
