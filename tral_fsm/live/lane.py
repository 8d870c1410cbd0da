"""One car with its driver: the loop that a page can watch and change between two ticks."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from tral_env.interface import CORE_LAYOUT, check_readings
from tral_env.se2 import Pose
from tral_fsm.evaluation.own_policy import as_policy, find_policy
from tral_fsm.live.frame import CarFrame
from tral_fsm.runtime.machine import Transit
from tral_fsm.runtime.policy import MachinePolicy

_OUTCOMES = (
    ("success", "arrived"),
    ("crash", "crash"),
    ("collision", "touched something"),
    ("missed_gate", "missed a gate"),
)


class Lane:
    """A simulated car, alone on its course, and the policy that drives it."""

    def __init__(self, env: gym.Env[Any, Any], source: str) -> None:
        """Take an environment over, and find the driver.

        Args:
            env: `TralCorridor-v0`.
            source: name or path of the policy.

        Raises:
            ConfigError: no such policy, or it needs readings that the car lacks.
        """
        self.env, self._world = env, env.unwrapped.world  # type: ignore[attr-defined]
        self._names = self._world.layout.names
        self.take_driver(source)
        self.ended = ""

    def take_driver(self, source: str) -> None:
        """Let another policy drive from now on."""
        policy = as_policy(find_policy(source))
        check_readings(policy, self.env)
        policy.reset(1)
        self.source, self.policy, self.transit = source, policy, None
        if isinstance(policy, MachinePolicy):
            policy.trace = self._fired

    def _fired(self, transit: Transit) -> None:
        self.transit = transit

    def start(self, seed: int, options: dict[str, Any] | None = None) -> None:
        """Begin a new episode."""
        self._observation, self._info = self.env.reset(seed=seed, options=options)
        self.policy.reset(1)
        self._action = np.zeros(2, np.float32)
        self.transit, self.ended = None, ""

    def tick(self) -> None:
        """Drive for one tick; a car that has ended stands."""
        if self.ended:
            return
        self._action = np.asarray(self.policy.act(np.array(self._observation)), np.float32)
        self._observation, _, terminated, truncated, self._info = self.env.step(self._action.copy())
        if terminated or truncated:
            self.ended = next((told for key, told in _OUTCOMES if self._info[key]), "out of time")

    def frame(self) -> CarFrame:
        """The car at this moment."""
        policy = self.policy
        states = policy.active_states
        pose: Pose = tuple(self._info["pose"].tolist())
        return CarFrame(
            name=self.source,
            time_s=float(self._info["time_s"]),
            readings=dict(zip(self._names, self._observation.tolist(), strict=True)),
            action=(float(self._action[0]), float(self._action[1])),
            pose=pose,
            qpos=self._world.sim.physics.qpos[0].copy(),
            state=states[0] if states else "",
            transit=self.transit,
            estimate=policy.estimates[0] if isinstance(policy, MachinePolicy) else None,
            truth=self._info,
            ended=self.ended,
        )
