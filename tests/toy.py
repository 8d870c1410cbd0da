"""A kinematic car among plane walls, seen from above: enough of a world to let a machine drive a corridor."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from tral_env.config import CarConfig
from tral_env.interface import CONTROL_PERIOD_S as TICK
from tral_env.interface import CORE_LAYOUT, NO_ECHO_M
from tral_fsm.runtime.driver import Driver

CAR = CarConfig()
SONARS = {
    "left": (CAR.middle_x, 0.1, math.pi / 2),
    "front": (CAR.front_x, 0.0, 0.0),
    "right": (CAR.middle_x, -0.1, -math.pi / 2),
}
BEAM, INCIDENCE = math.radians(27.5), math.radians(22.5)

Point = tuple[float, float]


@dataclass
class Toy:
    """Sonars answer every 70 ms, 65 ms late, in steps of 8.65 mm; the hall sensor counts ticks of 2.5 cm."""

    walls: list[tuple[Point, Point]]
    edges: list[Point] = field(default_factory=list)
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    trim: float = 0.0
    """Steering that the mechanism adds."""
    speed: float = 0.0
    wheel: float = 0.0
    driven: float = 0.0
    tick: int = 0
    seed: int = 1

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(self.seed)
        self.pending: list[tuple[int, dict[str, float]]] = []
        self.seen: tuple[int, dict[str, float]] | None = None
        self.action = np.zeros(2)
        self.path: list[tuple[float, float, float]] = []

    def echo(self, sonar: str) -> float:
        """Nearest wall met nearly at right angles, or nearest edge in the beam."""
        forward, left, turned = SONARS[sonar]
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        p = np.array([self.x + cos * forward - sin * left, self.y + sin * forward + cos * left])
        axis = self.yaw + turned
        candidates = [NO_ECHO_M]
        for a, b in np.array(self.walls):
            along = (b - a) / np.linalg.norm(b - a)
            foot = a + along * np.dot(p - a, along)
            if 0 <= np.dot(foot - a, along) <= np.linalg.norm(b - a):
                candidates += self._within(foot - p, axis, INCIDENCE)
        for edge in self.edges:
            candidates += self._within(np.array(edge) - p, axis, BEAM)
        return min(candidates)

    @staticmethod
    def _within(way: np.ndarray, axis: float, limit: float) -> list[float]:
        off = math.atan2(way[1], way[0]) - axis
        off = (off + math.pi) % (2 * math.pi) - math.pi
        distance = float(np.hypot(*way))
        return [distance] if abs(off) <= limit and distance < 5 else []

    def observe(self) -> np.ndarray:
        if self.tick % 6 == 0:
            steps = self.random.integers(0, 2, 3) * 0.00865
            self.pending.append(
                (self.tick, {name: self.echo(name) + step for name, step in zip(SONARS, steps, strict=True)})
            )
        while self.pending and self.tick - self.pending[0][0] >= 5:
            self.seen = self.pending.pop(0)
        values: dict[str, float] = {
            "distance": 0.02513 * math.floor(self.driven / 0.02513),
            "speed": abs(self.speed),
            "steering": self.action[0],
            "throttle": self.action[1],
        }
        if self.seen is not None:
            for name in SONARS:
                values[f"ultrasonic_{name}"] = self.seen[1][name]
                values[f"ultrasonic_{name}_age"] = (self.tick - self.seen[0]) * TICK
        return CORE_LAYOUT.pack(values, 1)[0]

    def drive(self, act: Callable[[np.ndarray], np.ndarray], seconds: float) -> None:
        for _ in range(round(seconds / TICK)):
            self.action = act(self.observe())
            self.wheel += float(np.clip(self.action[0] + self.trim - self.wheel, -TICK / 0.15, TICK / 0.15))
            wanted = 2.64 * max(self.action[1] - 0.1, 0.0)
            self.speed += (wanted - self.speed) * TICK / 0.25
            bend = math.tan(CAR.full_lock * self.wheel) / CAR.wheelbase
            step = self.speed * TICK
            self.x += step * math.cos(self.yaw + step * bend / 2)
            self.y += step * math.sin(self.yaw + step * bend / 2)
            self.yaw += step * bend
            self.driven += step * (1 - bend * CAR.track / 2)
            self.tick += 1
            self.path.append((self.x, self.y, self.yaw))


def one_car(driver: Driver) -> Callable[[np.ndarray], np.ndarray]:
    """What a machine answers to an observation; the driver can be looked into meanwhile."""
    return lambda observation: np.array(driver.act(observation.tolist()), np.float32)


def showing(
    world: Toy, act: Callable[[np.ndarray], np.ndarray], arrivals: Sequence[int], marker: int, x: float, y: float
) -> Callable[[np.ndarray], np.ndarray]:
    """What a car answers whose camera shows a marker that faces it at x, y in its frame.

    The images arrive at these ticks, 30 ms old, and their content ages until the next one.
    """

    def answer(observation: np.ndarray) -> np.ndarray:
        arrived = [tick for tick in arrivals if tick <= world.tick]
        if arrived:
            seen = {"id": marker, "x": x, "y": y, "heading": 0.0, "age": 0.03 + (world.tick - arrived[-1]) * TICK}
            for name, value in seen.items():
                observation[CORE_LAYOUT.column(f"marker_{name}")] = value
        return act(observation)

    return answer


def straight(width: float, **car: float) -> Toy:
    """A corridor along x, its middle line at y = 0."""
    half = width / 2
    return Toy([((-5, half), (100, half)), ((-5, -half), (100, -half))], **car)


def corner(turn: str, width: float, length: float = 4.0, **car: float) -> Toy:
    """A corridor along x whose end wall stands at x = length; it goes on to the left or right."""
    half, sign = width / 2, 1.0 if turn == "left" else -1.0
    inner = length - width
    outside = ((-5, -sign * half), (length, -sign * half))
    end = ((length, -sign * half), (length, sign * 30))
    inside = ((-5, sign * half), (inner, sign * half))
    beyond = ((inner, sign * half), (inner, sign * 30))
    return Toy([outside, end, inside, beyond], [(inner, sign * half)], **car)
