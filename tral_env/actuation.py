"""From a command to what servo and motor get: latency, servo, scrub of the tyres, motor controller, battery.

The models are pure functions over a leading axis (n, ...); `Actuation` keeps their state, a row for each car.
Only additions, products, quotients, comparisons and square roots are used, which IEEE 754 rounds alike everywhere, so
row i is the same bit for bit whatever the other rows do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tral_env.arrays import (
    ALL,
    ALONE,
    Array,
    Flags,
    Index,
    Rows,
    is_any,
    maximum,
    minimum,
    pick,
    sqrt,
    square,
    where,
)
from tral_env.config import CarConfig, EscConfig, ServoConfig
from tral_env.errors import ConfigError
from tral_env.geometry import scrub_fall
from tral_env.interface import CONTROL_PERIOD_S, CONTROL_RATE_HZ

DRIVE = 0
"""Phase of a motor controller that drives or lets the car coast."""
BRAKE = 1
"""Phase of a motor controller that brakes."""
WAIT = 2
"""Phase of a motor controller that got neutral after a brake that was long enough."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ActuationParameters:
    """What differs from car to car; each an array (n,). Write into the arrays, then call `Actuation.reset`."""

    steering_offset: Array
    """Steering angle at command 0: what calibration has left, rad."""
    mechanism_offset: Array
    """Middle of the linkage's travel, rad."""
    lock_scale: Array
    """Full lock relative to `CarConfig.full_lock_deg`."""
    servo_speed_scale: Array
    """Speed of the servo relative to `ServoConfig.speed`."""
    servo_strength_scale: Array
    """Strength of servo and saver relative to the model's. What shows is scrub over strength, so scrub is divided."""
    latency_s: Array
    """Delay of a command, s."""
    battery_v: Array
    """Voltage of the battery without load, V."""
    battery_resistance: Array
    """Inner resistance of battery and wires, ohm."""

    @classmethod
    def nominal(cls, n: int, esc: EscConfig | None = None) -> ActuationParameters:
        """Parameters of n cars without any scatter; a stiff battery."""
        esc = esc or EscConfig()
        return cls(
            steering_offset=np.zeros(n),
            mechanism_offset=np.zeros(n),
            lock_scale=np.ones(n),
            servo_speed_scale=np.ones(n),
            servo_strength_scale=np.ones(n),
            latency_s=np.full(n, esc.nominal_latency_s),
            battery_v=np.full(n, esc.battery_v),
            battery_resistance=np.zeros(n),
        )


@dataclass(kw_only=True, eq=False)
class ActuatorInputs:
    """What the model's actuators get for one control tick; each (n,)."""

    steering_angle: Array
    """Set point of the actuator `steer`: where the servo's horn stands, rad of bicycle angle."""
    voltage: Array
    """Control of the actuator `drive`: voltage at the motor, V."""
    scrub_torque: Array
    """`frictionloss` of the joint `steer`, N m."""
    battery_v: Array
    """Voltage of the battery under load, V."""


def steering_target(command: Array, neutral: Array, lock: Array, low: Array, high: Array) -> Array:
    """Angle that a steering command asks for: ``clip(neutral + lock * command, low, high)``.

    Args:
        command: steering in [-1, 1], (n,).
        neutral: angle at command 0, rad, (n,).
        lock: change of angle for command 1, rad, (n,).
        low: right end of the linkage's travel, rad, (n,).
        high: left end of it, rad, (n,).
    """
    target: Array = minimum(maximum(neutral + lock * command, low), high)
    return target


def servo_step(position: Array, moving: Flags, target: Array, max_step: Array, dead_zone: float) -> tuple[Array, Flags]:
    """One tick of a servo: it sets out when its error exceeds the dead zone and runs at its speed until it is there.

    With the error e = target - position, a servo that moves advances by ``clip(e, -w T, w T)``, w its speed, T the
    tick.

    Args:
        position: angle now, rad, (n,).
        moving: whether it was on its way, (n,).
        target: angle wanted, rad, (n,).
        max_step: speed times tick, rad, (n,).
        dead_zone: rad.

    Returns:
        Angle after the tick, and whether the target is still ahead.
    """
    error = target - position
    size = abs(error)
    moving = moving & (size > 0) | (size > dead_zone)
    step = minimum(maximum(error, -max_step), max_step)
    arrived = size <= max_step
    after = where(moving, where(arrived, target, position + step), position)
    return after, moving & (size > max_step)


def scrub_torque(speed: Array, standstill: Array | float, speed_scale: float) -> Array:
    """Friction torque of the front tyres against steering: ``M0 / sqrt(1 + (v / v0)^2)``, see `scrub_fall`.

    Args:
        speed: rolling speed, m/s, (n,).
        standstill: M0, N m, scalar or (n,).
        speed_scale: v0, m/s.

    Returns:
        N m, (n,).
    """
    result: Array = standstill / scrub_fall(speed, speed_scale, sqrt=sqrt, square=square)
    return result


def motor_duty(throttle: Array, dead_zone: float) -> Array:
    """Duty cycle of the motor controller: ``max(|throttle| - dead_zone, 0) / (1 - dead_zone)``, (n,) in [0, 1]."""
    result: Array = maximum(abs(throttle) - dead_zone, 0.0) / (1.0 - dead_zone)
    return result


def controller_step(
    direction: Array, phase: Index, held: Index, throttle: Array, dead_zone: float, switch_ticks: int
) -> tuple[Array, Index, Index]:
    """One tick of the motor controller's reverse logic, the same for both directions of travel.

    Throttle against the direction brakes. After at least `switch_ticks` of brake, neutral leads to WAIT (after less,
    back to DRIVE); after at least `switch_ticks` of neutral in WAIT, throttle against the direction turns the direction
    and drives, before that it brakes again. Throttle along the direction always drives.

    Args:
        direction: +1 forward, -1 reverse, (n,).
        phase: DRIVE, BRAKE or WAIT, (n,).
        held: ticks spent in BRAKE or WAIT, (n,).
        throttle: (n,) in [-1, 1].
        dead_zone: throttle up to this counts as neutral.
        switch_ticks: ticks that brake and neutral must last.

    Returns:
        Direction, phase and held after the tick.
    """
    demand = direction * throttle
    against = demand < -dead_zone
    ready = held >= switch_ticks
    turn = against & (phase == WAIT) & ready
    wait = (phase == WAIT) | (phase == BRAKE) & ready
    coasts = demand <= dead_zone
    after = where(turn, DRIVE, where(against, BRAKE, where(coasts & wait, WAIT, DRIVE)))
    held = where(after == DRIVE, 0, where(after == phase, held + 1, 1))
    return where(turn, -direction, direction), after, held


def drive_voltage(
    duty: Array, back_emf: Array, battery_v: Array, battery_resistance: Array, motor_resistance: float
) -> tuple[Array, Array]:
    """Motor voltage of a driving controller that chops the battery and lets the motor run free.

    With duty p the motor sees V = p U, the battery gives p I and sags: U = E - p I Rb, I = (V - e) / R, together
    ``V = (p E R + p^2 Rb e) / (R + p^2 Rb)``. A chopper only pushes: where V would be below the back-EMF e no current
    flows and the motor coasts, V = e.

    Args:
        duty: p, (n,).
        back_emf: e along the direction of drive, V, (n,).
        battery_v: E, V, (n,).
        battery_resistance: Rb, ohm, (n,).
        motor_resistance: R, ohm.

    Returns:
        V along the direction of drive and U, both in V, (n,).
    """
    sag = duty * duty * battery_resistance
    pushed = (duty * battery_v * motor_resistance + sag * back_emf) / (motor_resistance + sag)
    voltage = maximum(pushed, back_emf)
    current = (voltage - back_emf) / motor_resistance
    return voltage, battery_v - duty * current * battery_resistance


def brake_voltage(duty: Array, back_emf: Array) -> Array:
    """Motor voltage while braking: the motor is shorted for a share `duty` of the time, ``V = (1 - duty) e``.

    It never drives the car backwards: the current opposes the motion and ends with it.
    """
    return (1.0 - duty) * back_emf


class Actuation:
    """Actuators of n cars, one control tick (80 Hz) at a time."""

    def __init__(
        self,
        n: int,
        *,
        car: CarConfig | None = None,
        servo: ServoConfig | None = None,
        esc: EscConfig | None = None,
        lead_s: float = 0.0,
    ) -> None:
        """Nominal cars at rest, servo at command 0.

        Args:
            n: number of cars.
            car: their geometry.
            servo: their servos.
            esc: their motor controllers.
            lead_s: the horn's angle is handed on this much late, at most a tick, because the integrator that takes it
                steers this much too early.
        """
        self._car, self._servo, self._esc = car or CarConfig(), servo or ServoConfig(), esc or EscConfig()
        self._dead_zone = math.radians(self._servo.dead_zone_deg)
        self._switch_ticks = math.ceil(self._esc.switch_s * CONTROL_RATE_HZ - 1e-9)
        self._lead = lead_s * CONTROL_RATE_HZ
        self._depth = math.ceil(self._esc.max_latency_s * CONTROL_RATE_HZ) + 2
        self.parameters = ActuationParameters.nominal(n, self._esc)
        self._row = np.arange(n)
        self._history = np.zeros((n, self._depth, 2))
        self._cursor = np.zeros(n, np.int64)
        self._delay = np.zeros(n, np.int64)
        self._fraction = np.zeros(n)
        self._lock, self._low, self._high, self._max_step, self._scrub = np.zeros((5, n))
        self._position = np.zeros(n)
        self._moving = np.zeros(n, np.bool_)
        self._direction = np.ones(n)
        self._phase = np.zeros(n, np.int64)
        self._held = np.zeros(n, np.int64)
        self.reset(ALL)

    def reset(self, rows: Rows) -> None:
        """Put cars back to rest with neutral commands behind them, and take over their parameters.

        Args:
            rows: which, as indices or a slice.

        Raises:
            ConfigError: a latency that cannot be simulated.
        """
        parameters = self.parameters
        latency = parameters.latency_s[rows]
        if not np.all((latency >= 0) & (latency <= self._esc.max_latency_s)):
            raise ConfigError(f"latency_s = {latency}: expected 0 .. {self._esc.max_latency_s:g} s in each row")
        ticks = latency * CONTROL_RATE_HZ
        self._delay[rows] = np.floor(ticks)
        self._fraction[rows] = ticks - np.floor(ticks)
        travel = math.radians(self._servo.travel_deg)
        middle = parameters.mechanism_offset[rows]
        self._low[rows], self._high[rows] = middle - travel, middle + travel
        self._lock[rows] = self._car.full_lock * parameters.lock_scale[rows]
        self._max_step[rows] = self._servo.speed * CONTROL_PERIOD_S * parameters.servo_speed_scale[rows]
        self._scrub[rows] = self._servo.scrub_torque / parameters.servo_strength_scale[rows]
        self._history[rows] = 0.0
        self._cursor[rows] = 0
        neutral = parameters.steering_offset[rows]
        self._position[rows] = steering_target(
            np.zeros_like(neutral), neutral, self._lock[rows], self._low[rows], self._high[rows]
        )
        self._moving[rows] = False
        self._direction[rows] = 1.0
        self._phase[rows] = DRIVE
        self._held[rows] = 0

    def apply(self, rows: Rows, command: Array, speed: Array) -> ActuatorInputs:
        """One control tick of the named cars.

        Args:
            rows: which, distinct; k of them.
            command: steering and throttle, finite, (k, 2), or two numbers of a car alone; clipped to [-1, 1].
            speed: mean rate of the four wheels times the nominal wheel radius, m/s, (k,), or a number.

        Returns:
            What to write into the model for this tick, each (k,), or a number.
        """
        parameters = self.parameters
        steering, throttle = self._delayed(rows, command)
        target = steering_target(
            steering,
            pick(parameters.steering_offset, rows),
            pick(self._lock, rows),
            pick(self._low, rows),
            pick(self._high, rows),
        )
        before = pick(self._position, rows)
        angle, moving = servo_step(
            before, pick(self._moving, rows), target, pick(self._max_step, rows), self._dead_zone
        )
        voltage, battery_v = self._motor(rows, throttle, speed)
        held = angle + self._lead * (before - angle)
        self._position[rows], self._moving[rows] = angle, moving
        scrub = scrub_torque(speed, pick(self._scrub, rows), self._servo.scrub_speed)
        return ActuatorInputs(steering_angle=held, voltage=voltage, scrub_torque=scrub, battery_v=battery_v)

    def _delayed(self, rows: Rows, command: Array) -> tuple[Array, Array]:
        """Keep a command and give the one of `latency_s` ago: ``u(t - d) = (1 - f) u[k - m] + f u[k - m - 1]``.

        The delay d is m + f ticks, m whole and f in [0, 1).
        """
        row = ALONE if rows is ALONE else self._row[rows]
        cursor, fraction = pick(self._cursor, rows), pick(self._fraction, rows)
        for i, value in enumerate(command if rows is ALONE else command.T):
            self._history[row, cursor, i] = minimum(maximum(value, -1.0), 1.0)
        newer = cursor - pick(self._delay, rows)  # negative indices wrap around the ring by themselves
        now, before = self._history[row, newer].T, self._history[row, newer - 1].T
        if rows is ALONE:
            now, before = now.tolist(), before.tolist()
        self._cursor[rows] = (cursor + 1) % self._depth
        steering, throttle = ((1.0 - fraction) * u + fraction * v for u, v in zip(now, before, strict=True))
        return steering, throttle

    def _motor(self, rows: Rows, throttle: Array, speed: Array) -> tuple[Array, Array]:
        """Advance the motor controllers by a tick, and give the voltages (k,) at the motor and of the battery, V."""
        esc = self._esc
        direction, phase = pick(self._direction, rows), pick(self._phase, rows)
        # Else the step would change nothing.
        if is_any(phase != DRIVE) or is_any(direction * throttle < -esc.dead_zone):
            direction, phase, held = controller_step(
                direction, phase, pick(self._held, rows), throttle, esc.dead_zone, self._switch_ticks
            )
            self._direction[rows], self._phase[rows], self._held[rows] = direction, phase, held
        duty = motor_duty(throttle, esc.dead_zone)
        back_emf = esc.back_emf * speed
        battery_v = pick(self.parameters.battery_v, rows)
        pushed, loaded = drive_voltage(
            duty, direction * back_emf, battery_v, pick(self.parameters.battery_resistance, rows), esc.motor_resistance
        )
        braking = phase == BRAKE
        voltage = where(braking, brake_voltage(duty, back_emf), direction * pushed)
        return voltage, where(braking, battery_v, loaded)
