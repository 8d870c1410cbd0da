"""An episode of the real car: what it counts up, and how it is recorded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tral_env.hardware.pulses import CarCalibration
from tral_env.interface import Layout
from tral_env.recording.episodes import EpisodeRecorder


@dataclass(kw_only=True, eq=False)
class Episode:
    """What an episode counts up."""

    start_s: float = 0.0
    """Time of the reset on the environment's clock."""
    deadline_s: float | None = None
    """The period that runs ends at this time; None: the next step begins the schedule."""
    tick: int = 0
    """Number of steps."""
    late_ticks: int = 0
    """Number of steps that came too late."""
    lateness_s: float = 0.0
    """The last step came too late by this time."""
    observation: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    """What the policy was told last."""
    evidence: int = 0
    """Number of observations that differed from the one before, in all episodes."""
    measured: Mapping[str, float] = field(default_factory=dict)

    def weigh(self, readings: Mapping[str, float]) -> None:
        """Count an observation if a sensor measured something else than before.

        An age alone does not count, nor does the voltage of the battery: it flickers while all else is frozen.
        """
        measured = {name: value for name, value in readings.items() if not name.endswith("_age") and name != "battery"}
        self.evidence += measured != self.measured
        self.measured = measured


def episode_recorder(
    path: str | Path | None,
    layout: Layout,
    clock: Callable[[], float],
    calibration: CarCalibration,
    **options: object,
) -> EpisodeRecorder:
    """Recorder of an environment's episodes.

    Args:
        path: the first file; None: nothing is recorded.
        layout: columns of the observations.
        clock: clock of the environment, s.
        calibration: calibration of the car, which each file keeps.
        options: options of the environment; of an object the name of its class is kept.
    """
    plain = {name: _plain(value) for name, value in options.items()}
    files = {"calibration.json": calibration.model_dump_json(by_alias=True, indent=2).encode()}
    configuration = {"calibration": calibration.name, **plain}
    return EpisodeRecorder(path, layout=layout, clock=clock, configuration=configuration, files=files)


def _plain(value: object) -> object:
    return value if value is None or isinstance(value, str | int | float) else type(value).__name__
