"""The simulated car as the devices see it: it hears commands, and it answers rangings and turns a wheel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tral_env.arrays import Array, is_any, number
from tral_env.config import HallConfig
from tral_env.course.layout import Course
from tral_env.course.plan import Plan
from tral_env.interface import CONTROL_PERIOD_S, NO_ECHO_M
from tral_env.options import CorridorConfig
from tral_env.perception.degrade import ImageCorruption
from tral_env.sensors.hall import EdgeSpeed
from tral_env.sensors.ranging import SONARS
from tral_env.twin.camera import RenderRequest, RenderSetup
from tral_env.twin.serial_boards import BoardReadings
from tral_env.world import World, how_it_ended

_KEPT_S = 0.3
"""Rangings are kept so long."""
_MAX_BOUNCES = 3
"""A wall is heard so often: once, and again after each return of the sound to it. Source: choice."""
_MAGNETS = 8
BOARD_CADENCE_S = 0.07
"""The boards of the original cars range this often, s. Source: SRF08, 65 ms, and the board's own turn."""
BOUNCES_S = (0.0004, 0.0011)
"""A bouncing hall sensor gives two more edges so long after each, s."""
EMPTY_BATTERY_V = 4.5
"""A battery that sags ends here, V."""
_CAR = {"sonar_cadence_s": CONTROL_PERIOD_S, "sonar_together": 1.0}
"""The simulated sonars range in each tick: a sonar that fires gets the next ranging."""


class _EdgeLog(EdgeSpeed):
    """The edges of the hall sensor as they come, with their times."""

    def __init__(self) -> None:
        super().__init__(1, HallConfig())
        self.new: list[float] = []

    def edge(self, counted: Any, when: Any) -> None:
        if is_any(counted):
            self.new.append(float(number(when)))
        super().edge(counted, when)


@dataclass(frozen=True)
class DriveOutcome:
    """How a drive ended."""

    ended: str
    """See `tral_env.world.how_it_ended`."""
    time_s: float
    progress: float


class TwinCar:
    """One car on one course. Times are those of the twin's clock, s."""

    def __init__(self, config: CorridorConfig) -> None:
        """Build the world; `reset` must come first."""
        self._world = World(1, config)
        self._rangings: tuple[tuple[float, tuple[float, ...]], ...] = ()
        self._edges = _EdgeLog()
        self.outcome: DriveOutcome | None = None
        """How this drive ended, once it has; the car drives on."""
        self.info: dict[str, float | bool] = {}
        """Ground truth of the last tick, for people alone."""
        self.drawn: dict[str, float] = {}
        """Parameters of the car."""
        self.sags_v_per_s = 0.0
        """The battery loses so many volts in a second."""
        self.hall_off = self.hall_bounces = False
        """Whether no edge of the hall sensor comes, and whether each comes three times."""
        self._board = _empty_readings()

    def reset(self, seed: int, now_s: float) -> None:
        """Put the car at the start of the course of a seed, as the simulated environment does.

        Raises:
            ConfigError: the course cannot be had.
        """
        world, row = self._world, np.array([0])
        request = world.request(row, {"car": _CAR})
        drawn = world.reset(request, [np.random.default_rng(seed)])
        self.drawn = {name: float(values[0]) for name, values in drawn.items()}
        self._edges = _EdgeLog()
        world.sim.hall_wheel.hall.count_by(self._edges)
        self.outcome = None
        self._board, self._stamps = _empty_readings(), (0.0,) * _MAGNETS
        self._note(world.info())
        self._rangings = ()
        self._keep(now_s)

    @property
    def plan(self) -> Plan:
        """The course."""
        plan = self._world.plans[0]
        assert plan is not None, "reset comes first"
        return plan

    @property
    def course(self) -> Course:
        """The course as its file would say it."""
        course = self._world.courses[0]
        assert course is not None, "reset comes first"
        return course

    @property
    def readings(self) -> dict[str, float]:
        """What the simulated environment would tell a policy, by name."""
        return dict(zip(self._world.layout.names, self._world.observation()[0].tolist(), strict=True))

    @property
    def qpos(self) -> Array:
        """State of the car, to be rendered."""
        state: Array = self._world.sim.physics.qpos[0].copy()
        return state

    @property
    def camera_mounting(self) -> Array:
        """Roll, pitch, yaw of the camera's mounting error, rad."""
        mounting: Array = self._world.sim.cameras.mounting(np.array([0]))[0]
        return mounting

    def render_setup(self) -> RenderSetup:
        """What the camera stands in."""
        sim = self._world.sim
        faults = sim.image_faults or ImageCorruption()
        seed = int(sim.cameras.image_seeds[0])
        degradation, latency_s = self.drawn["image_degradation"], self.drawn["camera_latency_s"]
        return RenderSetup(sim.pool, self.plan, sim.lens, faults, degradation, seed, latency_s)

    def render_request(self, now_s: float, *, gone: bool, frozen: bool) -> RenderRequest:
        """What the camera sees at a time, s."""
        return RenderRequest(round(now_s * 1e9), self.qpos, self.camera_mounting, gone, frozen)

    @property
    def battery_v(self) -> float:
        """Voltage of the battery without load, V."""
        return float(self._world.sim.actuators.actuation.parameters.battery_v[0])

    @property
    def board_readings(self) -> BoardReadings:
        """What a board of the original cars reads from its sensors."""
        return self._board

    def tick(self, steering: float, throttle: float, now_s: float, together: bool) -> list[float]:
        """Drive for a control period that ends now.

        Args:
            steering: mean command of the period.
            throttle: mean command of the period.
            now_s: end of the period on the twin's clock, s.
            together: whether more than one sonar listens, so that they may hear each other.

        Returns:
            Times of the edges of the hall sensor in this period, s.

        Raises:
            SimulationError: the physics became unstable.
        """
        world = self._world
        world.sim.car_parameters.drawn["sonar_together"][0] = float(together)
        self._edges.new.clear()
        step = world.step(np.array([[steering, throttle]]))
        self._note(step.info)
        if self.outcome is None and (step.terminated[0] or step.truncated[0]):
            self.outcome = DriveOutcome(
                how_it_ended(step.info), float(self.info["time_s"]), float(self.info["progress"])
            )
        self._keep(now_s)
        self._sag()
        time_s = float(world.sim.time_s[0])
        edges_s = [] if self.hall_off else sorted(self._edges.new)
        if self.hall_bounces:
            edges_s = bouncing(edges_s)
        self._read_boards(time_s, edges_s)
        return [now_s - time_s + edge_s for edge_s in edges_s]

    def echoes(self, side: str, fired_s: float) -> list[float] | None:
        """Ranges of the echoes of a ranging that was fired at a time, m; None: the car has not come there yet."""
        for time_s, ranges in self._rangings:
            if time_s >= fired_s:
                return bounces(ranges[SONARS.index(side)])
        return None

    def close(self) -> None:
        """Free the world."""
        self._world.close()

    def _keep(self, now_s: float) -> None:
        sim = self._world.sim
        # What can be read now was measured a tick ago.
        told = sim.sonars.ranging.readings(sim.time_s)
        fired_s = now_s - max(float(told[f"ultrasonic_{side}_age"]) for side in SONARS)
        new = fired_s, tuple(sim.sonars.ranging.range_m[0].tolist())
        # A new tuple: the bus looks at it from its own thread.
        self._rangings = (*(old for old in self._rangings if old[0] >= now_s - _KEPT_S), new)

    def _sag(self) -> None:
        if self.sags_v_per_s:
            battery_v = self._world.sim.actuators.actuation.parameters.battery_v
            battery_v[0] = max(battery_v[0] - self.sags_v_per_s * CONTROL_PERIOD_S, EMPTY_BATTERY_V)

    def _read_boards(self, time_s: float, edges_s: Sequence[float]) -> None:
        """Let the boards' own sonars range in their cadence, and their counters count."""
        board = self._board
        self._stamps = (*self._stamps, *edges_s)[-_MAGNETS - 1 :]
        ranging = int(time_s / BOARD_CADENCE_S)
        fresh = ranging != board.ranging
        newest = dict(zip(SONARS, self._rangings[-1][1], strict=True))
        self._board = BoardReadings(
            range_m=newest if fresh else board.range_m,
            ranging=ranging,
            ticks=board.ticks + len(edges_s),
            spacing_s=self._stamps[-1] - self._stamps[-2],
            turn_s=self._stamps[-1] - self._stamps[0],
            battery_v=self.battery_v,
        )

    def _note(self, info: dict[str, Any]) -> None:
        self.info = {name: values[0].item() for name, values in info.items() if values.ndim == 1}
        x, y, yaw = info["pose"][0].tolist()
        self.info |= {"x": x, "y": y, "yaw": yaw}


def _empty_readings() -> BoardReadings:
    return BoardReadings(
        range_m=dict.fromkeys(SONARS, NO_ECHO_M), ranging=-1, ticks=0, spacing_s=0.0, turn_s=0.0, battery_v=0.0
    )


def bouncing(edges_s: Sequence[float]) -> list[float]:
    """Edges of a sensor that bounces, s, in their order."""
    return sorted([*edges_s, *(edge_s + late_s for edge_s in edges_s for late_s in BOUNCES_S)])


def bounces(range_m: float) -> list[float]:
    """Echoes of a wall, m: the sound comes back, and again after it went to and fro once and twice more."""
    return [] if range_m >= NO_ECHO_M else [range_m * k for k in range(1, _MAX_BOUNCES + 1)]
