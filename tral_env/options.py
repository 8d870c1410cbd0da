"""The options of the environments: each is a field of `CorridorConfig` and is spelled nowhere else."""

from __future__ import annotations

import copy
import inspect
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from gymnasium.envs.registration import EnvSpec

from tral_env.calibration.camera_info import load_lens
from tral_env.checks import as_config, is_number, one_of
from tral_env.config import CameraConfig, CarConfig, TaskConfig
from tral_env.course.generate import SCENARIOS
from tral_env.course.layout import Course, example_names, example_path
from tral_env.errors import ConfigError, UnknownOptionError, UnreadableCourseError, nearest
from tral_env.interface import Layout, group_names
from tral_env.learner import LearnerConfig, pair
from tral_env.perception.degrade import ImageCorruption
from tral_env.randomization import Randomization, level

Class = TypeVar("Class", bound=type)

Level = str | Path | Randomization

CAMERAS = ("projected", "rendered")


def _course_of_mapping(members: Mapping[str, Any]) -> Course:
    """The course that a mapping describes, which is what the JSON of an environment's spec holds.

    Raises:
        ConfigError: it holds what no course file could.
        CourseError: it is no course.
    """
    try:
        text = json.dumps(dict(members))
    except (TypeError, ValueError, RecursionError) as error:
        raise ConfigError(f"got {str(members)[:200]}: expected what a course file could hold: {error}") from error
    return Course.parse(text)


def _or_mapping(read: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Take a value as it is; but read a mapping."""
    return lambda value: read(value) if isinstance(value, Mapping) else value


def _one_or_several(read: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Take a value as it is, and a list as a tuple; but read a mapping."""
    one = _or_mapping(read)
    return lambda value: tuple(map(one, value)) if isinstance(value, list | tuple) else one(value)


@dataclass(frozen=True, kw_only=True)
class CorridorConfig(LearnerConfig):
    """What to drive, with which car and which eyes, and how a learner meets it.

    The environments take each field but `image_size` as an option, those of `LearnerConfig` too. An option is read by
    the function in its field's metadata; without one it is taken as it is.
    """

    scenario: str | tuple[str, ...] = field(default="office", metadata={"read": pair})
    """Family of the generated courses: one of `tral_env.course.generate.SCENARIOS`, which `tral courses` lists. Several
    in a tuple: every episode draws one of them."""
    course: Course | str | Path | None = field(default=None, metadata={"read": _or_mapping(_course_of_mapping)})
    """Every episode drives this `Course` instead of generated ones. Also its name, one of those that `tral courses`
    lists, the path of its JSON file, or a mapping of what that file would hold."""
    courses: int | None = None
    """Every episode draws one of so many courses, 1 or more. Each is built when it is first driven and then kept (up to
    40 kB); course k is the one that `reset(seed=k)` gives without this option. `None`: every episode builds a new
    course, which takes most of a reset."""
    anywhere: float = 0.0
    """Share of the episodes on generated courses that begin anywhere on the route instead of at its start, 0 to 1: a
    learner that crashes early sees more of the courses."""
    camera: str = "projected"
    """`"projected"`: the corners of the markers are projected through the lens, without OpenGL. `"rendered"`: OpenCV's
    detector searches a rendered image."""
    randomization: Level | tuple[Level, ...] = field(default="default", metadata={"read": _one_or_several(level)})
    """How much cars differ from one another: `"none"`, `"default"`, `"hard"`, the path of a file of ranges (.json,
    .yaml, .yml), or a `Randomization` of other ranges. Several in a tuple: every episode draws one of them."""
    groups: tuple[str, ...] = field(default=(), metadata={"read": group_names})
    """Optional groups of readings behind the core ones: names out of `"line"`, `"imu"`, `"battery"`."""
    car: CarConfig = field(default_factory=CarConfig, metadata={"read": partial(as_config, CarConfig)})
    """A `CarConfig`: the car's geometry. Only `full_lock_deg` may differ from the car of `assets/car.xml`."""
    lens: CameraConfig = field(default_factory=CameraConfig, metadata={"read": load_lens})
    """The camera's lens: a `CameraConfig`, `"default"`, `"wide"`, or the path of a calibration file (.yaml, .yml, .xml,
    .ini)."""
    task: TaskConfig = field(default_factory=TaskConfig, metadata={"read": partial(as_config, TaskConfig)})
    """A `TaskConfig`: the weights of the reward, the time limit and the speed of a crash."""
    image_faults: ImageCorruption = field(
        default_factory=ImageCorruption, metadata={"read": partial(as_config, ImageCorruption)}
    )
    """An `ImageCorruption`: how much of each fault an `image_degradation` of 1 brings to a rendered image. Streaks and
    covered patches are off by default."""
    image_size: tuple[int, int] | None = field(default=None, metadata={"is_option": False})
    """Width and height of the image in the observation, px; `TralCorridorPixels-v0` sets it. `None`: there is none."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.scenarios or (self.scenario,):
            one_of("scenario", name, SCENARIOS)
        one_of("camera", self.camera, CAMERAS)
        if self.courses is not None and not is_count(self.courses):
            raise ConfigError(f"courses = {self.courses!r}: expected a whole number, 1 or more, or None")
        if self.courses is not None and self.course is not None:
            raise ConfigError(f"courses = {self.courses!r} with a course of your own: expected one of them")
        if not is_number(self.anywhere) or not 0.0 <= self.anywhere <= 1.0:
            raise ConfigError(f"anywhere = {self.anywhere!r}: expected 0 to 1")
        if self.anywhere and self.course is not None:
            raise ConfigError(f"anywhere = {self.anywhere!r} with a course of your own: expected one of them")
        if self.camera == "projected" and self.image_size is None and self.image_faults != ImageCorruption():
            raise ConfigError(
                f"image_faults = {self.image_faults!r} with camera='projected', which takes no image: expected "
                "camera='rendered', or TralCorridorPixels-v0, whose observation has an image"
            )
        if not self.levels:
            raise ConfigError("randomization = (): expected one or more levels")
        Layout.of(self.groups)
        self._check_learner()
        for place in fields(CarConfig):
            got, has = getattr(self.car, place.name), getattr(CarConfig(), place.name)
            if place.name != "full_lock_deg" and got != has:
                raise ConfigError(f"CarConfig.{place.name} = {got!r}: the car of assets/car.xml has {has!r}")

    def _check_learner(self) -> None:
        """Refuse observations that cannot be: features show the core readings, and images have no history."""
        if self.observation == "features" and self.groups:
            raise ConfigError(
                f"groups = {self.groups!r} with observation='features', which are of the core readings alone: expected "
                "observation='readings', or no groups"
            )
        if self.image_size is not None and (self.observation != "readings" or self.history != 1):
            raise ConfigError(
                f"observation='{self.observation}', history={self.history} with images, which have neither features "
                "nor history: expected observation='readings' and history=1, or TralCorridor-v0"
            )

    @property
    def scenarios(self) -> tuple[str, ...]:
        """The families, one or several."""
        return self.scenario if isinstance(self.scenario, tuple) else (self.scenario,)

    @property
    def levels(self) -> tuple[Randomization, ...]:
        """The levels of randomization, one or several.

        Raises:
            ConfigError: one is unknown, or its file is not allowed.
        """
        given = self.randomization if isinstance(self.randomization, tuple) else (self.randomization,)
        return tuple(map(level, given))

    @property
    def learner(self) -> LearnerConfig:
        """The options of how a learner meets the car."""
        return LearnerConfig(**{place.name: getattr(self, place.name) for place in fields(LearnerConfig)})

    @property
    def learner_options(self) -> dict[str, object]:
        """The options, name -> value, by which a step takes and gives something else than a tick of the car does."""
        plain, names = LearnerConfig(), ("decision_hz", "observation", "history", "action", "drive_range")
        return {name: getattr(self, name) for name in names if getattr(self, name) != getattr(plain, name)}

    @classmethod
    def of(
        cls, options: Mapping[str, Any], *, allowed: Iterable[str] = (), image_size: tuple[int, int] | None = None
    ) -> CorridorConfig:
        """The configuration that the options of an environment ask for.

        Args:
            options: name -> value. None stands for the default of `car`, `lens`, `task` and `image_faults`, a mapping
                for one that went through JSON.
            allowed: names of all that the environment takes, which the error tells; empty: the options alone.
            image_size: width and height of the image in the observation, px; None: there is none.

        Raises:
            UnknownOptionError: there is no option of that name.
            ConfigError: a value is not allowed.
        """
        known, values = {option.name: option for option in option_fields()}, {}
        for name, value in options.items():
            if name not in known:
                raise UnknownOptionError(f"unknown option '{name}': {nearest(name, [*allowed] or known)}")
            read = known[name].metadata.get("read")
            values[name] = value if read is None else _read(name, read, value)
        return cls(image_size=image_size, **values)

    def fixed_course(self) -> Course | None:
        """The course that every episode drives, if there is one."""
        return as_course(self.course)


def option_fields() -> list[Field[Any]]:
    """The fields of `CorridorConfig` that are options, in order; those of how a learner meets the car come last."""
    of_learner = [place.name for place in fields(LearnerConfig)]
    options = [place for place in fields(CorridorConfig) if place.metadata.get("is_option", True)]
    return sorted(options, key=lambda place: place.name in of_learner)


def _read(name: str, read: Callable[[Any], Any], value: object) -> Any:
    try:
        return read(value)
    except ConfigError as error:
        raise ConfigError(f"option '{name}': {error}") from error


def option_parameters() -> list[inspect.Parameter]:
    """The options as keyword parameters with their defaults, for `takes`."""
    defaults = {option.name: None if option.default is MISSING else option.default for option in option_fields()}
    return [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default) for name, default in defaults.items()
    ]


def takes(parameters: Iterable[inspect.Parameter]) -> Callable[[Class], Class]:
    """Decorate a class so that `inspect.signature`, `help` and editors tell what its ``**options`` are.

    Args:
        parameters: keyword parameters that stand for ``**options`` of `__init__`.
    """

    def tell(cls: Class) -> Class:
        init = cls.__dict__["__init__"]
        own = [each for each in inspect.signature(init).parameters.values() if each.kind is not each.VAR_KEYWORD]
        init.__signature__ = inspect.Signature([*own, *parameters])
        return cls

    return tell


def is_count(value: object) -> bool:
    """Whether a value is a whole number from 1 to the largest int64; `True` is none."""
    return is_number(value, whole=True) and 1 <= value <= np.iinfo(np.int64).max


def check_counts(**counts: object) -> None:
    """Refuse values that are no counts.

    Args:
        counts: name -> value.

    Raises:
        ConfigError: one of them is no whole number, 1 or more.
    """
    for name, count in counts.items():
        if not is_count(count):
            raise ConfigError(f"{name} = {count!r}: expected a whole number, 1 or more")


def as_plain(value: Any) -> Any:
    """An option as JSON can hold it: what the environments make the same of. Configurations stay, see `JsonSpec`."""
    if isinstance(value, Course):
        return json.loads(value.to_json())
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, tuple):
        return tuple(map(as_plain, value))
    if isinstance(value, dict):
        return {name: as_plain(item) for name, item in value.items()}
    return value


class JsonSpec:
    """Base of environments whose spec survives JSON with all options; Gymnasium itself writes only configurations."""

    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's record of how the environment was made."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = copy.copy(spec)
        if self._spec is not None:
            self._spec.kwargs = as_plain(self._spec.kwargs)


def as_course(course: Course | str | Path | Mapping[str, Any] | None) -> Course | None:
    """A course: that of the package if a name was given, read from its file if a path was given, or of a mapping.

    Raises:
        ConfigError: none of these, or the file cannot be opened.
        CourseError: the file is no course.
    """
    if isinstance(course, str | Path):
        try:
            return Course.load(example_path(str(course)) if course in example_names() else course)
        except UnreadableCourseError as error:
            raise ConfigError(_unreadable(course, error.__cause__ or error)) from error
    if isinstance(course, Mapping):
        return _course_of_mapping(course)
    if course is not None and not isinstance(course, Course):
        raise ConfigError(f"course = {course!r}: expected a Course, or the name or the path of one")
    return course


def _unreadable(course: str | Path, error: BaseException) -> str:
    """Why a course file cannot be opened; the name of a family is no path."""
    told = f"course = {str(course)[:200]!r}: cannot be read: {getattr(error, 'strerror', error)}"
    if str(course) in tuple(SCENARIOS):
        return f"{told}. It is a family: scenario={str(course)!r}, or --scenario {course} on the command line"
    return f"{told}. Expected a Course, the path of its file, or its name: {nearest(course, example_names())}"
