"""Simulated drives as recordings, and recordings as episodes: with these, both go the same way from there on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from tral_env.course.layout import Course
from tral_env.errors import BadFileError
from tral_env.randomization import level
from tral_env.recording.read import Recording
from tral_env.recording.recorder import Recorder
from tral_env.world import Step
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.episode import Episode, Tick, TickRecorder
from tral_fsm.evaluation.loop import DriveLoop, Observer, Pair
from tral_fsm.evaluation.policy_files import MACHINE
from tral_fsm.formats import read as read_machine
from tral_fsm.runtime.machine import Trace, Transit

Index = NDArray[np.int64]
COURSE = "course.json"
"""A recording of a simulated drive keeps its course under this name."""


class DriveRecorder:
    """Records a simulated drive, images of a rendered camera too; `drive` takes it as `on_step`.

    Example:
        with DriveRecorder(Path("drive.mcap"), env, seed=7) as recorder:
            drive(env, policy, 7, on_step=recorder)
    """

    def __init__(
        self,
        path: Path,
        env: gym.Env[Any, Any],
        *,
        seed: int,
        scenario: str = "",
        policy: str = "",
        files: Mapping[str, bytes] | None = None,
    ) -> None:
        """Name the file, which the first tick makes.

        Args:
            path: the file; it must not exist.
            env: `TralCorridor-v0`.
            seed: seed of the episode.
            scenario: name of the course or family.
            policy: name or path of the policy.
            files: files of the policy, name -> content.
        """
        self._path, self._env = path, env.unwrapped
        self._told = {"seed": seed, "scenario": scenario, "policy": policy}
        self._files, self._exposures = dict(files or {}), 0
        self.recorder: Recorder | None = None
        """Writes the file; None before the first tick."""

    def __call__(self, tick: Tick) -> None:
        """Record a tick."""
        world: Any = self._env
        if self.recorder is None:
            self.recorder = self._begin(world)
        steering, throttle = world.world.sim.command[0].tolist()
        self.recorder.tick(
            time_s=float(tick.info["time_s"]),
            observation=tick.observation,
            action=tick.action,
            applied=(steering, throttle),
            state=tick.state,
            wanted=tick.wanted,
            transitions=tick.transits,
            truth={**tick.info, "clearance_error_m": tick.clearance_error},
        )
        self._look(world, float(tick.info["time_s"]))

    def _begin(self, world: Any) -> Recorder:
        config = world.world.config
        drawn = world.world.sim.car_parameters.drawn
        configuration = {
            **self._told,
            "env": {
                "camera": config.camera,
                "randomization": asdict(level(config.randomization)),
                "lens": asdict(config.lens),
                "groups": list(config.groups),
            },
            "car": {name: float(values[0]) for name, values in drawn.items()},
        }
        files = {COURSE: world.course.to_json().encode(), **self._files}
        layout = world.world.layout
        return Recorder(self._path, source="simulation", layout=layout, configuration=configuration, files=files)

    def _look(self, world: Any, time_s: float) -> None:
        """Record the image that a rendered camera has taken in this tick, if it has."""
        taken = int(world.world.sim.cameras.exposures[0])
        if world.world.config.camera == "rendered" and taken != self._exposures and self.recorder is not None:
            lens = world.world.config.lens
            self.recorder.image(time_s, world.render_view("onboard", lens.width, lens.height))
        self._exposures = taken

    def __enter__(self) -> Self:
        """The recorder."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        """Close the file, whatever happened."""
        if self.recorder is not None:
            self.recorder.close()


def course_of(recording: Recording) -> Course | None:
    """The course that a recording keeps; None: it keeps none."""
    text = recording.files.get(COURSE)
    return None if text is None else Course.parse(text.decode())


def machine_of(recording: Recording) -> MachineDefinition | None:
    """The machine that drove, if the recording keeps one."""
    text = recording.files.get(MACHINE)
    return None if text is None else read_machine(text, str(recording.path), ".json")


def episode_of(recording: Recording, on_step: Observer | None = None) -> Episode:
    """The episode that a recording of a simulated drive holds: its ticks go through the drive loop again.

    Args:
        recording: the recording.
        on_step: called with each tick.

    Raises:
        BadFileError: there is no tick, or no ground truth.
    """
    if not len(recording.tick) or not all("success" in truth for truth in recording.truth):
        raise BadFileError(f"{recording.path}: expected ticks with ground truth: the recording of a simulated drive")
    car, recorder = _RecordedCar(recording), TickRecorder()

    def observe(tick: Tick) -> None:
        recorded = replace(tick, state=recording.states[tick.index])
        recorder(recorded)
        if on_step is not None:
            on_step(recorded)

    loop = DriveLoop(1, car, _RecordedPolicy(recording), lambda step, row: car.info)
    loop.begin(np.zeros(1, np.int64), {0: [observe]})
    for _ in recording.tick:
        loop.tick()
    loop.end(0)
    told = recording.configuration
    figures = loop.metrics.figures(0, car.info)
    return Episode(seed=int(told["seed"]), scenario=str(told["scenario"]), trace=recorder.trace(), **figures)


class _RecordedCar:
    """A recorded drive as a row of cars: whatever it is told, it does what it did."""

    def __init__(self, recording: Recording) -> None:
        self._recording, self._tick = recording, 0
        self.info: dict[str, Any] = {}
        """Info of the last tick."""

    def observation(self) -> NDArray[np.floating]:
        rows = self._recording.observation
        row: NDArray[np.floating] = rows[min(self._tick, len(rows) - 1)][None]
        return row

    def step(self, command: NDArray[np.floating], rows: Index | None = None) -> Step:
        truth = self._recording.truth[self._tick]
        self._tick += 1
        self.info = {name: value for name, value in truth.items() if name not in ("tick", "x_m", "y_m", "yaw_rad")}
        self.info["pose"] = np.array([truth["x_m"], truth["y_m"], truth["yaw_rad"]])
        numbers = {name: np.array([value], float) for name, value in self.info.items() if isinstance(value, float)}
        over = np.array([self._tick == len(self._recording.tick)])
        return Step(self.observation(), np.zeros(1), over, over, dict(numbers), {})


class _RecordedPolicy:
    """The policy of a recorded drive: it answers what it answered."""

    def __init__(self, recording: Recording) -> None:
        self._recording, self._tick = recording, -1
        self._trace: Trace | None = None
        self._fired: dict[int, list[Transit]] = {}
        for one in recording.transitions:
            self._fired.setdefault(one.tick, []).append(Transit(*one[1:]))

    def act(self, rows: Index, observation: NDArray[np.floating]) -> tuple[Sequence[Any], Sequence[Pair]]:
        self._tick += 1
        for fired in self._fired.get(int(self._recording.tick[self._tick]), ()):
            if self._trace is not None:
                self._trace(fired)
        side, metres = self._recording.wanted[self._tick].tolist()
        return [self._recording.action[self._tick]], [(side, metres)]

    def state(self, row: int) -> str:
        return ""

    def watch(self, row: int, trace: Trace | None) -> None:
        self._trace = trace
