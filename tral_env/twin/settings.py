"""What a twin is: which course, which car, which files."""

from __future__ import annotations

import json
import os
import re
import tempfile
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from tral_env.checks import is_number, is_seed
from tral_env.errors import ConfigError, nearest
from tral_env.options import CorridorConfig

MIN_OSCILLATOR_HZ, MAX_OSCILLATOR_HZ = 24.0e6, 28.7e6
"""Clocks of PCA9685 boards that owners measured."""
BOARDS = ("pca9685", "sysfs-pwm", "board2016", "ucboard")
"""What sends the pulses to servo and motor controller: the PWM board, the kernel's PWM chip, or a serial board."""


@dataclass(frozen=True, kw_only=True)
class TwinSettings:
    """Settings of a twin."""

    name: str = "twin"
    """Name of the twin; its files lie in a folder of this name."""
    scenario: str = "office"
    """Family of the courses."""
    course: str | None = None
    """Name or path of the one course that is driven instead of a family."""
    seed: int = 7
    """Draws course, car, noise and the board's clock."""
    randomization: str = "default"
    """How much cars differ: name of a level, or path of a file of ranges."""
    oscillator_hz: float | None = None
    """Clock of the PWM board, Hz; None: drawn from the seed, 24.0 to 28.7 MHz."""
    calibration: str = "tt01"
    """Which pulses servo and motor controller take for left, straight, right, forward, neutral, reverse: the name of a
    packaged calibration or the path of a file. Of that file they know no clock."""
    board: str = "pca9685"
    """What is wired to servo and motor controller: one of `BOARDS`."""
    bus: int | None = 7
    """Number N of the bus: root gets a link /dev/i2c-N to its file. None: no link."""
    files: bool = True
    """Whether the bus and the PWM chip are files. False: they are objects in the twin's process alone."""
    serial: bool = True
    """Whether the two serial boards have a pseudo-terminal each."""
    camera: bool = False
    """Whether the camera's images are served. It needs OpenGL."""
    folder: str | None = None
    """Folder of the twin's files; None: one of the twin's name in /run, or where files of the moment belong."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_name(self.name)
        if not is_seed(self.seed) or self.seed is None:
            raise ConfigError(f"seed = {self.seed!r}: expected a whole number, 0 or more")
        if self.board not in BOARDS:
            raise ConfigError(f"board = {self.board!r}: {nearest(self.board, BOARDS)}")
        if self.oscillator_hz is not None and not (is_number(self.oscillator_hz) and 20e6 < self.oscillator_hz < 30e6):
            raise ConfigError(f"oscillator_hz = {self.oscillator_hz!r}: expected 20e6 to 30e6, or None")
        if self.bus is not None and not (is_number(self.bus, whole=True) and 0 <= self.bus < 1000):
            raise ConfigError(f"bus = {self.bus!r}: expected a whole number from 0 to 999, or None")
        self.corridor()

    def corridor(self) -> CorridorConfig:
        """Course and car, as the simulated environment has them.

        Raises:
            ConfigError: an unknown family or level.
        """
        return CorridorConfig.of(
            {"scenario": self.scenario, "course": self.course, "randomization": self.randomization}
        )

    @property
    def clock_hz(self) -> float:
        """Clock of the PWM board, Hz."""
        if self.oscillator_hz is not None:
            return float(self.oscillator_hz)
        return round(float(np.random.default_rng([self.seed, 9685]).uniform(MIN_OSCILLATOR_HZ, MAX_OSCILLATOR_HZ)))

    @property
    def run_folder(self) -> Path:
        """Folder of the twin's files."""
        return Path(self.folder) if self.folder else runtime_folder(self.name)

    def to_json(self) -> str:
        """The settings as text."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> TwinSettings:
        """Settings from text.

        Raises:
            ConfigError: an unknown setting, or a value that is not allowed.
        """
        content: dict[str, Any] = json.loads(text)
        known = [each.name for each in fields(cls)]
        for name in content:
            if name not in known:
                raise ConfigError(f"unknown setting '{name}': {nearest(name, known)}")
        return cls(**content)


def check_name(name: str) -> None:
    """Check the name of a twin, which is that of a folder with a socket in it.

    Raises:
        ConfigError: it is no such name.
    """
    if not re.fullmatch(r"[\w-][\w.-]{0,39}", name):
        raise ConfigError(f"name = {name!r}: expected up to 40 letters, digits, - or _")


def runtime_folder(name: str) -> Path:
    """Where the files of a twin lie: /run for root, else the user's own folder of the moment.

    Raises:
        ConfigError: no twin can have this name.
    """
    check_name(name)
    if os.geteuid() == 0:
        return Path("/run/tral-twin") / name
    return Path(os.environ.get("XDG_RUNTIME_DIR", tempfile.gettempdir())) / f"tral-twin-{os.getuid()}" / name
