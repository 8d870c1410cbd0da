"""Where a driver sits: in the real car, or in a simulated one that keeps real time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tral_env.interface import CONTROL_PERIOD_S, CONTROL_RATE_HZ, CORE_LAYOUT

if TYPE_CHECKING:
    from tral_env.hardware.car_file import CarFile
    from tral_env.hardware.env import TralCarEnv
    from tral_fsm.evaluation.recording import DriveRecorder

Observation = NDArray[np.float32]


class Moment(NamedTuple):
    """What came of a tick."""

    observation: Observation
    readings: Mapping[str, float]
    """By name, with what the observation has no field for."""
    late_ticks: int
    retries: int
    warnings: tuple[str, ...]
    over: str
    """Why the drive is over; empty: it goes on."""


class Seat(Protocol):
    """A car in which a policy or a person drives."""

    def begin(self, policy: Any) -> Observation:
        """Arm, and begin to record what the policy does."""
        ...

    def step(self, action: NDArray[np.floating]) -> Moment:
        """Drive for a tick, to its end in real time."""
        ...

    def stop(self) -> None:
        """Stop at once."""

    def say(self, text: str, level: str) -> None:
        """Put a word into the recording."""

    def close(self) -> None:
        """Let go of the car and of the recording."""


class AskedOfCar(Protocol):
    """What a drive asks of the real car."""

    @property
    def dry(self) -> bool:
        """Whether the pulses are only recorded."""

    @property
    def max_duration_s(self) -> float:
        """The drive ends after this time, s."""


def open_car(
    car: CarFile,
    asked: AskedOfCar,
    record: Path | None,
    clock: Callable[[], float],
    sleep: Callable[[float], None],
    options: Mapping[str, Any],
) -> TralCarEnv:
    """Open the real car.

    Args:
        car: its car file.
        asked: what the drive asks of it.
        record: file of the recording; None: none is written.
        clock: gives a time that never goes back, s.
        sleep: waits some seconds.
        options: more options of the environment.

    Raises:
        ConfigError: an option or the car file cannot be used.
        HardwareError: a device does not answer.
    """
    from tral_env.hardware.env import TralCarEnv

    return TralCarEnv(
        config=car,
        output="recorder" if asked.dry else None,
        max_duration_s=asked.max_duration_s,
        record=record,
        clock=clock,
        sleep=sleep,
        **options,
    )


class CarSeat:
    """The real car."""

    def __init__(self, env: TralCarEnv, files: Mapping[str, bytes]) -> None:
        """Sit down in an open car; the recording keeps the files of the policy."""
        self._env, self._files = env, files

    def begin(self, policy: Any) -> Observation:
        """See `Seat.begin`."""
        self._env.recording.watch(policy, self._files)
        return self._env.reset()[0]

    def step(self, action: NDArray[np.floating]) -> Moment:
        """See `Seat.step`."""
        observation, _, _, truncated, info = self._env.step(action)
        return Moment(
            observation,
            self._env.readings,
            info["late_ticks"],
            self._env.retries,
            info.get("warnings", ()),
            "time limit" if truncated else "",
        )

    def stop(self) -> None:
        """See `Seat.stop`."""
        self._env.stop()

    def say(self, text: str, level: str) -> None:
        """See `Seat.say`."""
        self._env.recording.say(text, level)

    def close(self) -> None:
        """See `Seat.close`."""
        self._env.close()


@dataclass(frozen=True, kw_only=True)
class Course:
    """Which simulated car drives where."""

    scenario: str
    """Family of the courses."""
    seed: int
    course: str | None = None
    """Name or path of the one course that is driven instead of a family."""
    randomization: str = "default"


class SimulatedSeat:
    """A simulated car that drives in real time."""

    def __init__(
        self,
        course: Course,
        record: Path | None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        max_duration_s: float = math.inf,
    ) -> None:
        """Build the car; it stands.

        Args:
            course: which car drives where.
            record: file of the recording; None: none is written.
            clock: gives a time that never goes back, s.
            sleep: waits some seconds.
            max_duration_s: simulated time after which the drive is over, s.

        Raises:
            ConfigError: there is no such family or level.
        """
        import gymnasium as gym

        self._env = gym.make(
            "tral_env:TralCorridor-v0",
            scenario=course.scenario,
            course=course.course,
            randomization=course.randomization,
            disable_env_checker=True,
        )
        self._course, self._record, self._clock, self._sleep = course, record, clock, sleep
        self._max_ticks = max_duration_s * CONTROL_RATE_HZ
        self._policy: Any = None
        self._recorder: DriveRecorder | None = None
        self._ticks, self._late, self._deadline_s = 0, 0, clock()
        self._observation: Observation = np.zeros(0, np.float32)

    def begin(self, policy: Any) -> Observation:
        """See `Seat.begin`."""
        self._policy = policy
        self._observation, _ = self._env.reset(seed=self._course.seed)
        if self._record is not None:
            from tral_fsm.evaluation.recording import DriveRecorder

            self._recorder = DriveRecorder(
                self._record, self._env, seed=self._course.seed, scenario=self._course.scenario, policy="by hand"
            )
        self._deadline_s = self._clock() + CONTROL_PERIOD_S
        return self._observation

    def step(self, action: NDArray[np.floating]) -> Moment:
        """See `Seat.step`."""
        told = self._observation
        self._observation, _, terminated, truncated, info = self._env.step(action)
        self._keep(told, action, info)
        now_s = self._clock()
        self._late += now_s > self._deadline_s
        if now_s < self._deadline_s:
            self._sleep(self._deadline_s - now_s)
        self._deadline_s = max(self._deadline_s, now_s) + CONTROL_PERIOD_S
        over = ""
        if terminated or truncated:
            over = "the goal" if info["success"] else "a touch" if info["collision"] else "a missed gate or the time"
        elif self._ticks >= self._max_ticks:
            over = "time limit"
        readings = {name: float(value) for name, value in CORE_LAYOUT.unpack(self._observation).items()}
        return Moment(self._observation, readings, self._late, 0, (), over)

    def stop(self) -> None:
        """Do nothing: a simulated car that nobody steps stands."""

    def say(self, text: str, level: str) -> None:
        """See `Seat.say`."""
        if self._recorder is not None and self._recorder.recorder is not None:
            self._recorder.recorder.say(self._ticks * CONTROL_PERIOD_S, text, level)

    def close(self) -> None:
        """See `Seat.close`."""
        if self._recorder is not None:
            self._recorder.__exit__(None, None, None)
        self._env.close()

    def _keep(self, told: Observation, action: NDArray[np.floating], info: dict[str, Any]) -> None:
        """Record the tick."""
        self._ticks += 1
        if self._recorder is not None:
            from tral_fsm.evaluation.episode import Tick

            states = self._policy.active_states
            self._recorder(
                Tick(
                    index=self._ticks - 1,
                    observation=told,
                    state=states[0] if states else "",
                    action=np.asarray(action, np.float32),
                    info=info,
                )
            )
