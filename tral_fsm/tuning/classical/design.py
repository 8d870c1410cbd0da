"""Gains and margins from a linear model of the car along a wall, to compare with what a search finds.

The model is a kinematic bicycle of wheelbase L at small angles and constant speed v. Its side ultrasonic stands m ahead
of the rear axle. The plant leads from the steering angle to e, range minus wanted clearance:
G(s) = v^2 / (L s^2) + m v / (L s). The machine's law, steering = p e + d e' as a share of full lock, acts late: by the
ultrasonic's cadence, by half of it again because a range is held, and for e' by half of it once more because e' is
taken between two ranges; then by the latency of the command and the lag of the servo.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tral_env.config import EscConfig, UltrasonicConfig
from tral_env.errors import ConfigError
from tral_env.geometry import FULL_LOCK, SIDE_SONAR_X_M, WHEELBASE_M
from tral_fsm.control.laws import lqr_damping

Array = NDArray[np.float64]

KP = 1.0
"""Default of `lqr`: steering angle for a metre of deviation, rad/m; the car comes to its line within about 1 m. Source:
choice."""
_FREQUENCIES = np.geomspace(0.02, 200.0, 4000)
_STEP_S = 0.002


@dataclass(frozen=True, kw_only=True)
class LinearCar:
    """The car and its delays; the defaults are those of the simulation's nominal car."""

    wheelbase: float = WHEELBASE_M
    """L, m."""
    lock: float = FULL_LOCK
    """Steering angle at command 1, rad."""
    sonar_x: float = SIDE_SONAR_X_M
    """m, the side ultrasonic ahead of the rear axle, m."""
    cadence_s: float = UltrasonicConfig.cadence_s
    """Time between two ranges, s; a range is that old when it arrives."""
    latency_s: float = EscConfig.nominal_latency_s
    """Time from command to pulse, s."""
    servo_s: float = 0.04
    """Time constant of the servo, s. Source: measured in the simulation, from pulse to yaw rate."""

    @property
    def delay_s(self) -> float:
        """Time from a deviation to the pulse that answers it, s; the servo's lag is not in it."""
        return 1.5 * self.cadence_s + self.latency_s

    @property
    def rate_delay_s(self) -> float:
        """Time by which e' is later than e, s."""
        return 0.5 * self.cadence_s


@dataclass(frozen=True, kw_only=True)
class Gains:
    """p [1/m] and d [s/m] of a machine."""

    p: float
    d: float


@dataclass(frozen=True, kw_only=True)
class Margins:
    """How far a loop is from oscillating."""

    speed: float
    """m/s"""
    phase_deg: float
    """Smallest phase margin over all crossings, deg; infinite without a crossing."""
    gain: float
    """Factor on both gains at which the loop oscillates for ever; infinite where there is none."""
    delay_s: float
    """Additional delay from which on the loop oscillates, s."""
    damping: float
    """Damping ratio of the least damped pair of poles; 1 without such a pair, below 0 where the oscillation grows."""
    frequency: float
    """Frequency of that pair, rad/s; 0 without such a pair."""

    @property
    def stable(self) -> bool:
        """Whether oscillations die away."""
        return self.damping > 0.0


def lqr(speed: float, kp: float = KP, car: LinearCar | None = None) -> Gains:
    """Gains that minimize the integral of q e^2 + r delta^2 for a car without delays, kp = sqrt(q / r).

    The command is a share of full lock, so p = kp / lock; `lqr_damping` gives d, and the damping 0.707 at any speed.

    Args:
        speed: v, m/s.
        kp: steering angle for a metre of deviation, rad/m.
        car: the car whose wheelbase and lock count.

    Raises:
        ConfigError: a number is not above 0.
    """
    car = car or LinearCar()
    if not (speed > 0.0 and kp > 0.0):
        raise ConfigError(f"speed = {speed:g} m/s, kp = {kp:g} rad/m: expected numbers above 0")
    p = kp / car.lock
    return Gains(p=p, d=lqr_damping(p, speed, car.wheelbase, car.lock))


def ideal_damping(gains: Gains, speed: float, car: LinearCar | None = None) -> float:
    """Damping ratio of the car without delays, at the rear axle: kd v / (2 sqrt(L kp))."""
    car = car or LinearCar()
    kp, kd = gains.p * car.lock, gains.d * car.lock
    return kd * speed / (2.0 * math.sqrt(car.wheelbase * kp))


def loop(gains: Gains, speed: float, frequency: Array, car: LinearCar | None = None) -> NDArray[np.complex128]:
    """Response of the open loop at frequencies [rad/s], (n,) complex."""
    car = car or LinearCar()
    s = 1j * frequency
    plant = speed**2 / (car.wheelbase * s**2) + car.sonar_x * speed / (car.wheelbase * s)
    law = gains.p + gains.d * s * np.exp(-s * car.rate_delay_s)
    result: NDArray[np.complex128] = car.lock * plant * law * np.exp(-s * car.delay_s) / (1.0 + car.servo_s * s)
    return result


def margins(gains: Gains, speed: float, car: LinearCar | None = None) -> Margins:
    """Phase, gain and delay margin and the damping of the least damped pair of poles."""
    car = car or LinearCar()
    response = loop(gains, speed, _FREQUENCIES, car)
    size, phase = np.abs(response), _phase(response)
    gain_crossings = np.flatnonzero((size[:-1] >= 1.0) & (size[1:] < 1.0))
    phase_margins = [float(math.pi + phase[k]) for k in gain_crossings]
    delay_margins = [margin / _FREQUENCIES[k] for margin, k in zip(phase_margins, gain_crossings, strict=True)]
    damping, frequency = dominant(gains, speed, car)
    return Margins(
        speed=speed,
        phase_deg=math.degrees(min(phase_margins, default=math.inf)),
        gain=min((float(1.0 / size[k]) for k in _phase_crossings(phase)), default=math.inf),
        delay_s=float(min(delay_margins, default=math.inf)),
        damping=damping,
        frequency=frequency,
    )


def _phase(response: NDArray[np.complex128]) -> Array:
    """Continuous phase of an open loop, (n,) rad; it begins near -pi."""
    phase: Array = np.unwrap(np.angle(response))
    phase += 2.0 * math.pi * round((-math.pi - phase[0]) / (2.0 * math.pi))
    return phase


def _phase_crossings(phase: Array) -> NDArray[np.int64]:
    """Indices at which a phase falls through -pi."""
    return np.flatnonzero((phase[:-1] > -math.pi) & (phase[1:] <= -math.pi))


def dominant(gains: Gains, speed: float, car: LinearCar | None = None) -> tuple[float, float]:
    """Damping ratio and frequency [rad/s] of the least damped pair of poles; delays are Pade approximants (3, 3).

    A pair does not count if it is faster than a quarter of the rate at which ranges could show it (12 rad/s for 65 ms)
    and dies away within three ranges: the model means little there.
    """
    car = car or LinearCar()
    numerator, denominator = _pade(car.delay_s)
    rate_up, rate_down = _pade(car.rate_delay_s)
    law = np.polyadd(gains.p * rate_down, np.polymul([gains.d, 0.0], rate_up))
    plant = car.lock / car.wheelbase * np.array([car.sonar_x * speed, speed**2])
    up = np.polymul(np.polymul(plant, law), numerator)
    down = np.polymul(np.polymul([car.servo_s, 1.0], [1.0, 0.0, 0.0]), np.polymul(denominator, rate_down))
    poles = np.roots(np.polyadd(down, up))
    slow, lasts = np.abs(poles) < math.pi / (4.0 * car.cadence_s), poles.real > -1.0 / (3.0 * car.cadence_s)
    pairs = poles[(poles.imag > 1e-9) & (slow | lasts)]
    if not len(pairs):
        return (1.0 if poles.real.max() < 0.0 else -1.0), 0.0
    damping = -pairs.real / np.abs(pairs)
    worst = int(damping.argmin())
    return float(damping[worst]), float(abs(pairs[worst]))


def _pade(delay: float) -> tuple[Array, Array]:
    """Numerator and denominator of the Pade approximant (3, 3) of e^(-s delay)."""
    t = delay
    even, odd = np.array([0.0, 12.0 * t**2, 0.0, 120.0]), np.array([t**3, 0.0, 60.0 * t, 0.0])
    return even - odd, even + odd


def step_response(gains: Gains, speed: float, seconds: float, car: LinearCar | None = None) -> tuple[Array, Array]:
    """Response of the linear model to a step of the wanted clearance from 0 to 1.

    Returns:
        (k,) time since the step [s] and (k,) clearance at the ultrasonic.
    """
    car = car or LinearCar()
    count, dt = math.ceil(seconds / _STEP_S), _STEP_S
    late, later = round(car.delay_s / dt), round((car.delay_s + car.rate_delay_s) / dt)
    latency = round(car.latency_s / dt)
    clearance = np.zeros(count)
    y = heading = angle = 0.0
    follow = min(dt / car.servo_s, 1.0)
    for k in range(1, count):
        e = (clearance[k - 1 - late] if k - 1 >= late else 0.0) - (1.0 if k - 1 >= latency else 0.0)
        rate = (clearance[k - 1 - later] - clearance[k - 2 - later]) / dt if k - 2 >= later else 0.0
        angle += ((-car.lock * (gains.p * e + gains.d * rate)) - angle) * follow
        heading += speed / car.wheelbase * angle * dt
        y += speed * heading * dt
        clearance[k] = y + car.sonar_x * heading
    return dt * np.arange(count, dtype=np.float64), clearance


def overshoot(response: Array) -> float:
    """Part of a response to a step of 1 that lies above 1; 0 if none does."""
    return max(float(np.max(response)) - 1.0, 0.0)


def damping_of(height: float) -> float:
    """Damping ratio of a second order system with the overshoot h: -ln h / sqrt(pi^2 + ln^2 h); 1 without overshoot."""
    if height <= 1e-6:
        return 1.0
    log = math.log(min(height, 1.0))
    return -log / math.hypot(math.pi, log)


def schedule(speeds: Sequence[float], kp: float = KP, car: LinearCar | None = None) -> list[tuple[Gains, Margins]]:
    """LQR gains at each speed, with the margins that the delays leave."""
    return [(gains := lqr(speed, kp, car), margins(gains, speed, car)) for speed in speeds]


@dataclass(frozen=True, kw_only=True)
class LimitCycle:
    """An oscillation that neither grows nor dies away."""

    speed: float
    ultimate_gain: float
    """Ku, the gain p at which the loop oscillates for ever, 1/m."""
    period_s: float
    """Tu, s."""
    amplitude_m: float
    """NaN for a cycle of the linear model."""

    def ziegler_nichols(self) -> Gains:
        """PD gains of Ziegler and Nichols: p = 0.8 Ku, d = p Tu / 8."""
        p = 0.8 * self.ultimate_gain
        return Gains(p=p, d=p * self.period_s / 8.0)


def predicted_limit_cycle(speed: float, car: LinearCar | None = None) -> LimitCycle | None:
    """Limit cycle of the linear model by p alone; None where no p gives one."""
    response = loop(Gains(p=1.0, d=0.0), speed, _FREQUENCIES, car)
    crossings = _phase_crossings(_phase(response))
    if not len(crossings):
        return None
    k = int(crossings[0])
    return LimitCycle(
        speed=speed,
        ultimate_gain=float(1.0 / abs(response[k])),
        period_s=float(2.0 * math.pi / _FREQUENCIES[k]),
        amplitude_m=math.nan,
    )
