"""One car with its driver: what a page watches, and changes between two ticks."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from tral_env.checks import one_of
from tral_env.errors import ConfigError, PolicyError, TralError, reason
from tral_env.interface import CONTROL_PERIOD_S, MAX_AGE_S, Policy, check_readings
from tral_env.se2 import Pose
from tral_env.simulation.sim import CHANGEABLE
from tral_env.world import how_it_ended
from tral_fsm.evaluation.own_policy import as_policy, find_policy
from tral_fsm.live.frame import CarFrame
from tral_fsm.runtime.machine import Transit
from tral_fsm.runtime.policy import MachinePolicy
from tral_fsm.tuning.parameters import Value, with_value

SIDES = ("left", "front", "right")
ARRIVED = "arrived"
_WORDS = {"success": ARRIVED, "collision": "touched something"}
"""How a drive ended -> what is told of it, where that is something else."""
Find = Callable[[str], Policy]
"""Gives the policy of a name or path."""
FAULTS = (Exception, SystemExit)
"""What the code of a policy may raise, its own exit too."""


def words_of(error: BaseException) -> str:
    """An error in a line: the whole message of ours, the reason alone of a policy's, the place of anybody else's."""
    if isinstance(error, PolicyError) and error.why:
        return error.why
    return str(error) if isinstance(error, TralError) else reason(error)


class Lane:
    """A simulated car, alone on its course, and the policy that drives it."""

    def __init__(
        self,
        env: gym.Env[Any, Any],
        driver: str,
        find: Find = find_policy,
        on_failure: Callable[[str], None] | None = None,
    ) -> None:
        """Take an environment over, and find the driver.

        Args:
            env: `TralCorridor-v0`.
            driver: name or path of the policy.
            find: gives a policy by its name.
            on_failure: is told, once, that the driver failed, in a line.

        Raises:
            ConfigError: no such policy, or it needs readings that the car lacks.
        """
        world: Any = env.unwrapped
        self.env, self.world, self._find = env, world.world, find
        self._stills = world.stills()
        self._names = self.world.layout.names
        self._observation: NDArray[np.float32] = np.zeros(len(self._names), np.float32)
        self._action = np.zeros(2, np.float32)
        self._info: dict[str, Any] = {}
        self._silent: dict[str, int] = {}
        """Ultrasonic that was taken away -> ticks since then."""
        self.ended = ""
        self._on_failure, self._has_failed = on_failure, False
        self.transit: Transit | None = None
        self.take_driver(driver)

    def take_driver(self, driver: str) -> None:
        """Let another policy drive from now on; it begins as at the start of a drive, and goes on where one failed.

        Raises:
            TralError: no such policy, or it cannot drive this car.
        """
        policy = as_policy(self._find(driver))
        check_readings(policy, self.env)
        policy.reset(1)
        self.driver, self.policy = driver, policy
        self.transit = None
        if self._has_failed:
            self._has_failed, self.ended = False, ""
        if isinstance(policy, MachinePolicy):
            policy.trace = self._note
            self.as_loaded = policy.definition
            """The machine as its file has it."""

    def _note(self, transit: Transit) -> None:
        self.transit = transit

    def retune(self, path: str, value: Value | None) -> None:
        """Change a number of the machine at once.

        Args:
            path: such as `state[follow].p`; see `tral_fsm.tuning.parameters`.
            value: the new one; None: null, where the definition allows it.

        Raises:
            ConfigError: no machine drives, it has no such number, or does not allow the value.
        """
        if not isinstance(self.policy, MachinePolicy):
            raise ConfigError(f"{self.driver} is no machine: it has no number {path}")
        self.policy.retune(with_value(self.policy.definition, path, value))

    def retune_all(self) -> None:
        """Give the machine back the numbers of its file."""
        if isinstance(self.policy, MachinePolicy):
            self.policy.retune(self.as_loaded)

    def start(self, seed: int) -> None:
        """Begin a new episode; what was taken away is back."""
        self._put_at_start(seed)
        self.policy.reset(1)

    def restart(self, seed: int) -> None:
        """As `start`, but a driver that fails there ends its drive, as one that fails in a tick."""
        self._put_at_start(seed)
        try:
            self.policy.reset(1)
        except FAULTS as error:
            self._fail(error)

    def _put_at_start(self, seed: int) -> None:
        self._observation, self._info = self.env.reset(seed=seed)
        self._action = np.zeros(2, np.float32)
        self._silent.clear()
        self.transit, self.ended, self._has_failed = None, "", False

    def tick(self) -> None:
        """Drive for one tick; a car whose drive has ended stands, and an error of its policy ends it."""
        if self.ended:
            return
        try:
            self._action = np.asarray(self.policy.act(np.array(self._observation)), np.float32)
        except FAULTS as error:
            self._fail(error)
            return
        try:
            self._step()
        except TralError as error:
            self.ended = f"an error: {error}"

    def _fail(self, error: BaseException) -> None:
        """End the drive for the driver's fault, and tell that once."""
        if self._has_failed:
            return
        self._has_failed = True
        self.ended = f"driver {self.driver} failed at {self._info['time_s']:.2f} s: {words_of(error)}"
        if self._on_failure is not None:
            self._on_failure(self.ended)

    def _step(self) -> None:
        observation, _, terminated, truncated, self._info = self.env.step(self._action.copy())
        self._observation = self._silenced(observation) if self._silent else observation
        if terminated or truncated:
            ended = how_it_ended(self._info)
            is_crash = ended == "collision" and self._info["crash"]
            self.ended = "crash" if is_crash else _WORDS.get(ended, ended)

    def silence(self, side: str, silent: bool) -> None:
        """Take an ultrasonic away, so that its last reading grows old, or give it back."""
        one_of("ultrasonic", side, SIDES)
        self._silent.pop(side, None)
        if silent:
            self._silent[side] = 0

    def _silenced(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """The observation where the silent ultrasonics still read what they read last."""
        told = observation.copy()
        for side in self._silent:
            self._silent[side] += 1
            reading, age = self._names.index(f"ultrasonic_{side}"), self._names.index(f"ultrasonic_{side}_age")
            told[reading] = self._observation[reading]
            told[age] = min(float(self._observation[age]) + CONTROL_PERIOD_S, MAX_AGE_S)
        return told

    def push(self, forward: float, left: float) -> None:
        """Shove the car, m/s."""
        self.world.sim.push(0, forward, left)

    def change(self, **values: float) -> None:
        """Change parameters of the car; see `Simulation.change`."""
        self.world.sim.change(0, **values)

    def parameters(self) -> dict[str, float]:
        """Those that may be changed, by name."""
        drawn = self.world.sim.car_parameters.drawn
        return {name: float(drawn[name][0]) for name in CHANGEABLE}

    def look(self, width: int, height: int) -> Callable[[], NDArray[np.uint8]]:
        """What the car's camera shows now, as a function that renders it, (height, width, 3)."""
        picture: Callable[[], NDArray[np.uint8]] = self._stills.take("onboard", width, height)
        return picture

    def place(self) -> tuple[Pose, float]:
        """True pose, and share of the route."""
        return tuple(self._info["pose"].tolist()), float(self._info["progress"])

    def frame(self) -> CarFrame:
        """The car at this moment."""
        policy, info = self.policy, self._info
        state, (side, clearance) = self._told()
        pose, progress = self.place()
        there = math.nan if math.isnan(side) else info.get(f"clearance_{'left' if side > 0 else 'right'}_m", math.nan)
        return CarFrame(
            name=self.driver,
            time_s=float(info["time_s"]),
            readings=dict(zip(self._names, self._observation.tolist(), strict=True)),
            action=(float(self._action[0]), float(self._action[1])),
            pose=pose,
            qpos=self.world.sim.physics.qpos[0].copy(),
            state=state,
            transit=self.transit,
            estimate=policy.estimates[0] if isinstance(policy, MachinePolicy) else None,
            speed_mps=float(info["speed_mps"]),
            wanted_mps=float(policy.speed_target[0]) if isinstance(policy, MachinePolicy) else math.nan,
            clearance_error_m=there - clearance,
            gates=(int(info["gates_passed"]), int(info["gates_total"])),
            progress=progress,
            silent=tuple(self._silent),
            ended=self.ended,
        )

    def _told(self) -> tuple[str, tuple[float, float]]:
        """What the driver says of itself: its state, and side and clearance that it wants."""
        try:
            states = self.policy.active_states
            side, clearance = self.policy.wanted_clearance[0].tolist()
        except FAULTS as error:
            self._fail(error)
            return "", (math.nan, math.nan)
        return states[0] if states else "", (side, clearance)

    def close(self) -> None:
        """Free what the environment holds."""
        self.env.close()
