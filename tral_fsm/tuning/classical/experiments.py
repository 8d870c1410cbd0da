"""Experiments in the simulation to check the linear model: a step in the wanted clearance, and a relay."""

from __future__ import annotations

import contextlib
import math

import numpy as np
from numpy.typing import NDArray

from tral_env.course.layout import Course, Segment, Start
from tral_env.geometry import SIDE_SONAR_Y_M
from tral_env.interface import CONTROL_PERIOD_S, CONTROL_RATE_HZ, CORE_LAYOUT
from tral_env.speed_control import speed_control
from tral_env.vector_env import TralCorridorVectorEnv
from tral_fsm.conditions.simple import DistanceSpec
from tral_fsm.control.laws import damping
from tral_fsm.definition.machine import MachineDefinition, TransitionSpec
from tral_fsm.runtime.policy import MachinePolicy
from tral_fsm.states.wall import BasicFollowWallSpec, WallSpec
from tral_fsm.tuning.classical.design import Gains, LimitCycle
from tral_fsm.tuning.classical.loops import Response, WallGains

Array = NDArray[np.float64]

_BEFORE_M = 2.0
"""Way before the step, on which the start-up dies away."""
_WIDTH, _CLEARANCE = 2.4, 0.8
"""Width of the corridor and clearance before the step, m."""


def corridor(length: float, clearance: float = _CLEARANCE) -> Course:
    """A straight corridor in which the car starts at a clearance to the right wall; lengths in m."""
    offset = clearance + SIDE_SONAR_Y_M - _WIDTH / 2.0
    return Course(name="step", segments=(Segment(length=length, width=_WIDTH),), start=Start(at=1.0, offset=offset))


def stepper(gains: Gains, speed: float, step: float) -> MachineDefinition:
    """A machine that follows the right wall by p and d without clips; after 2 m the clearance grows by the step [m]."""
    follow = {"side": "right", "p": gains.p, "d": gains.d, "speed": speed, "reach": 5.0, "final": True}
    no_clips = {"max_error": None, "max_angle_deg": None, "max_rate": 1000.0}
    clearances = (_CLEARANCE, _CLEARANCE + step)
    return MachineDefinition(
        root=0,
        states=tuple(
            BasicFollowWallSpec.model_validate({"id": number, "clearance": clearance, **follow, **no_clips})
            for number, clearance in enumerate(clearances)
        ),
        transitions=(
            TransitionSpec.model_validate({"id": 0, "from": 0, "to": 1, "when": DistanceSpec(distance=_BEFORE_M)}),
        ),
    )


def step(
    gains: Gains,
    speed: float,
    *,
    size: float = 0.15,
    seconds: float = 6.0,
    cars: int = 8,
    randomization: str = "none",
    seed: int = 0,
) -> Response:
    """Drive a step in the wanted clearance.

    Args:
        gains: gains of the wall following.
        speed: m/s.
        size: height of the step, m.
        seconds: time that is recorded after the step, s.
        cars: number of cars; each has a seed of its own.
        randomization: level at which the cars differ: none, default or hard.
        seed: seed of the first car.
    """
    machine = stepper(gains, speed, size)
    course = corridor(_BEFORE_M + 4.0 + 1.2 * speed * seconds)
    policy = MachinePolicy(machine)
    policy.reset(cars)
    keep = math.ceil(seconds * CONTROL_RATE_HZ)
    clearance, count = np.full((cars, keep), np.nan), np.zeros(cars, int)
    with contextlib.closing(
        TralCorridorVectorEnv(cars, autoreset_mode="Disabled", course=course, randomization=randomization)
    ) as env:
        observation, _ = env.reset(seed=seed)
        ended = np.zeros(cars, bool)
        while not (ended | (count >= keep)).all():
            observation, _, terminated, truncated, info = env.step(policy.act(observation))
            ended |= terminated | truncated
            stepped = np.array(policy.active_states) == "1"
            now = (info["clearance_right_m"] - _CLEARANCE) / size
            for row in np.flatnonzero(stepped & ~ended & (count < keep)):
                clearance[row, count[row]] = now[row]
                count[row] += 1
    time = CONTROL_PERIOD_S * np.arange(keep, dtype=np.float64)
    return Response(time=time, clearance=clearance, step_m=size, randomization=randomization)


def relay(
    speed: float, *, height: float = 0.6, seconds: float = 24.0, cars: int = 8, seed: int = 0
) -> LimitCycle | None:
    """Steer the car by a relay along the wall, and measure the limit cycle.

    The steering is `height` towards the wall when the range is above the wanted clearance, else away from it. The car
    oscillates where the loop's phase is -180 degrees; at the amplitude a the relay is a gain of 4 height / (pi a).

    Args:
        speed: m/s.
        height: steering of the relay, share of full lock; a small one drowns in the ultrasonic's jitter.
        seconds: length of the experiment, s; the last two thirds count.
        cars: number of cars whose cycles are averaged.
        seed: seed of the first car.

    Returns:
        None without a limit cycle: the oscillation grows until a car hits a wall or turns by more than 45 degrees.

    Source: Astrom and Hagglund 1984, Automatic tuning of simple regulators.
    """
    wanted = _WIDTH / 2.0 - SIDE_SONAR_Y_M
    course = corridor(4.0 + 1.3 * speed * seconds, wanted)
    column = CORE_LAYOUT.column
    track = []
    with contextlib.closing(
        TralCorridorVectorEnv(cars, autoreset_mode="Disabled", course=course, randomization="none")
    ) as env:
        observation, _ = env.reset(seed=seed)
        integral = [0.0] * cars
        for _ in range(math.ceil(seconds * CONTROL_RATE_HZ)):
            command = np.zeros((cars, 2), np.float32)
            command[:, 0] = np.where(observation[:, column("ultrasonic_right")] > wanted, -height, height)
            for row, now in enumerate(observation[:, column("speed")].tolist()):
                command[row, 1], integral[row] = speed_control(speed, now, integral[row])
            observation, _, terminated, truncated, info = env.step(command)
            clearance = info["clearance_right_m"]
            if (terminated | truncated | np.isnan(clearance)).any():
                return None
            track.append(clearance - wanted)
    return _limit_cycle(np.array(track[len(track) // 3 :]).T, speed, height)


def _limit_cycle(track: Array, speed: float, height: float) -> LimitCycle | None:
    """Limit cycle of n cars from their deviations (n, k) [m]; None if these grow, or do not oscillate."""
    centred = track - track.mean(axis=1, keepdims=True)
    half = centred.shape[1] // 2
    growth = np.median(centred[:, half:].std(axis=1) / centred[:, :half].std(axis=1))
    ups = [np.flatnonzero((row[:-1] < 0.0) & (row[1:] >= 0.0)) for row in centred]
    if growth > 1.5 or min(len(up) for up in ups) < 3:
        return None
    period = float(np.median([np.mean(np.diff(up)) for up in ups])) * CONTROL_PERIOD_S
    amplitude = math.sqrt(2.0) * float(np.median(centred.std(axis=1)))
    return LimitCycle(
        speed=speed,
        ultimate_gain=4.0 * height / (math.pi * amplitude),
        period_s=period,
        amplitude_m=amplitude,
    )


def wall_gains(machine: MachineDefinition) -> list[WallGains]:
    """Gains of the states that follow a wall at a regulated speed; inner machines are not looked at."""
    return [
        WallGains(
            name=state.label or str(state.id),
            gains=Gains(p=state.p, d=damping(state.p, state.speed) if state.d is None else state.d),
            speed=state.speed,
            place=("states", k),
        )
        for k, state in enumerate(machine.states)
        if isinstance(state, WallSpec) and state.speed
    ]
