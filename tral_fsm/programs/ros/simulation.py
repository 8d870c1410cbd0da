"""The simulated car as the body of the car node."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tral_env.interface import CONTROL_PERIOD_S
from tral_env.ros import topics
from tral_env.ros.body import Tick
from tral_env.ros.msg.std import String
from tral_env.ros.readings import Told
from tral_fsm.control.speed import BRAKE


@dataclass(frozen=True, kw_only=True)
class SimulationOptions:
    """Which simulated car drives where."""

    scenario: str = "office"
    course: str | None = None
    seed: int = 7
    randomization: str = "default"
    real_time: bool = True
    """Whether a tick takes its 1/80 s; else as long as it takes."""


class SimulatedBody:
    """One car of TralCorridor-v0. Before it is armed first it waits at the start, and its time stands."""

    name = "simulation"

    def __init__(self, options: SimulationOptions) -> None:
        """Build the world, and put the car at the start.

        Raises:
            ConfigError: there is no such family, course or level.
        """
        import gymnasium as gym

        self._options = options
        self.env = gym.make(
            "tral_env:TralCorridor-v0",
            scenario=options.scenario,
            course=options.course,
            randomization=options.randomization,
            groups=("imu", "battery"),
            disable_env_checker=True,
        )
        self._layout = self.env.unwrapped.world.layout  # type: ignore[attr-defined]
        self.sim_time_s = 0.0
        self.sees = True
        self._due_s = time.monotonic()
        self.reset(options.seed)

    def reset(self, seed: int) -> None:
        """See `Body.reset`."""
        self._seed = seed
        observation, self.info = self.env.reset(seed=seed)
        self._tick = Tick(self._named(observation))
        self._waits, self._over, self._armed = True, "", False

    def arm(self) -> Tick:
        """See `Body.arm`; a drive that is over begins again."""
        if self._over:
            self.reset(self._seed)
        self._armed = True
        self._due_s = time.monotonic() + CONTROL_PERIOD_S
        return self._tick

    def step(self, steering: float, throttle: float) -> Tick:
        """See `Body.step`."""
        self._waits = False
        if not self._over:
            observation, _, terminated, truncated, self.info = self.env.step(np.array([steering, throttle], np.float32))
            self._over = _ended(self.info) if terminated or truncated else ""
            self._tick = Tick(self._named(observation), self._over)
        self._pace()
        return self._tick

    def rest(self) -> Tick:
        """See `Body.rest`."""
        if self._waits or self._over:
            self._pace()
            return self._tick
        rolls = self.info["speed_mps"] > 0.05
        return self.step(0.0, -BRAKE if rolls else 0.0)

    def stop(self) -> None:
        """See `Body.stop`."""
        self._armed = False

    def extra(self, now_ns: int) -> Sequence[Told]:
        """Where the car is."""
        return ()

    def latched(self, now_ns: int) -> Sequence[Told]:
        """The course."""
        return ()

    def result(self) -> Told:
        """How the drive ended."""
        keys = ("success", "collision", "missed_gate", "progress", "time_s", "gates_passed", "gates_total")
        told: dict[str, Any] = {key: np.asarray(self.info[key]).item() for key in keys}
        return Told(topics.RESULT, String(json.dumps({"seed": self._seed, "ended": self._over, **told})))

    def close(self) -> None:
        """See `Body.close`."""
        self.env.close()

    def _named(self, observation: Any) -> dict[str, float]:
        return {name: float(value) for name, value in self._layout.unpack(observation).items()}

    def _pace(self) -> None:
        self.sim_time_s += 0.0 if self._waits else CONTROL_PERIOD_S
        if not self._options.real_time:
            if self._waits or self._over:
                time.sleep(CONTROL_PERIOD_S)
            return
        now_s = time.monotonic()
        if now_s < self._due_s:
            time.sleep(self._due_s - now_s)
        self._due_s = max(self._due_s, now_s) + CONTROL_PERIOD_S


def _ended(info: dict[str, Any]) -> str:
    if info["success"]:
        return "success"
    if info["collision"]:
        return "collision"
    return "missed gate" if info["missed_gate"] else "time is up"
