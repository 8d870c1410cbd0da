"""The linear model, by hand and against the simulation."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.config import CarConfig, EscConfig, UltrasonicConfig
from tral_env.errors import ConfigError
from tral_fsm import load_machine
from tral_fsm.tuning.classical.design import (
    Gains,
    LinearCar,
    damping_of,
    dominant,
    ideal_damping,
    loop,
    lqr,
    margins,
    overshoot,
    predicted_limit_cycle,
    step_response,
)
from tral_fsm.tuning.classical.experiments import relay, step, wall_gains

SHARP = LinearCar(cadence_s=1e-6, latency_s=0.0, servo_s=1e-6, sonar_x=0.0)
"""Without delays, looking from the rear axle."""


def test_the_nominal_car_is_the_simulated_one() -> None:
    car, linear = CarConfig(), LinearCar()
    assert (linear.wheelbase, linear.sonar_x) == (car.wheelbase, car.middle_x)
    assert linear.lock == pytest.approx(car.full_lock)
    assert linear.cadence_s == UltrasonicConfig().cadence_s
    assert linear.latency_s == EscConfig().nominal_latency_s


def test_lqr_gains_by_hand() -> None:
    gains = lqr(0.5, kp=1.0)
    lock = math.radians(22.0)
    assert gains.p == pytest.approx(1.0 / lock)
    assert gains.d == pytest.approx(math.sqrt(2.0 * 0.258) / 0.5 / lock)


@given(speed=st.floats(0.1, 5.0), kp=st.floats(0.05, 20.0))
def test_lqr_gives_the_damping_of_a_butterworth_filter_at_any_speed(speed: float, kp: float) -> None:
    assert ideal_damping(lqr(speed, kp), speed) == pytest.approx(math.sqrt(0.5))


def test_without_delays_the_poles_are_those_of_the_second_order_system() -> None:
    damping, frequency = dominant(lqr(0.7, kp=1.0), 0.7, SHARP)
    assert damping == pytest.approx(math.sqrt(0.5), abs=1e-3)
    assert frequency == pytest.approx(0.7 * math.sqrt(1.0 / 0.258), rel=1e-3)


def test_the_open_loop_at_one_frequency_by_hand() -> None:
    car, w, v = LinearCar(), 3.0, 0.7
    s = 1j * w
    plant = v**2 / (0.258 * s**2) + 0.129 * v / (0.258 * s)
    late = cmath.exp(-s * (1.5 * 0.065 + 0.02)) / (1.0 + 0.04 * s)
    law = 1.2 + 1.5 * s * cmath.exp(-s * 0.065 / 2)
    assert loop(Gains(p=1.2, d=1.5), v, np.array([w]), car)[0] == pytest.approx(math.radians(22) * plant * law * late)


def test_the_gain_margin_is_the_factor_at_which_the_damping_is_lost() -> None:
    gains = Gains(p=1.2, d=1.5)
    factor = margins(gains, 0.7).gain
    for times, stable in ((0.97, True), (1.03, False)):
        assert margins(Gains(p=gains.p * factor * times, d=gains.d * factor * times), 0.7).stable is stable


def test_the_delay_margin_is_the_delay_at_which_the_damping_is_lost() -> None:
    gains, car = lqr(1.2), LinearCar()
    more = margins(gains, 1.2).delay_s
    for times, stable in ((0.95, True), (1.05, False)):
        assert margins(gains, 1.2, replace(car, latency_s=car.latency_s + more * times)).stable is stable


def test_delays_cost_phase_the_more_the_faster_the_car() -> None:
    phases = [margins(lqr(speed), speed).phase_deg for speed in (0.3, 0.7, 1.2, 2.0)]
    assert phases == sorted(phases, reverse=True)
    assert phases[0] > 60.0 > 30.0 > phases[-1]


def test_overshoot_and_damping_are_one_to_one() -> None:
    assert damping_of(math.exp(-math.pi * 0.5 / math.sqrt(0.75))) == pytest.approx(0.5)
    assert damping_of(0.0) == 1.0


def test_the_step_of_the_ideal_car_is_the_textbook_one() -> None:
    _, response = step_response(Gains(p=lqr(0.7).p, d=lqr(0.7).d / math.sqrt(2.0)), 0.7, 8.0, SHARP)
    assert overshoot(response) == pytest.approx(math.exp(-math.pi / math.sqrt(3.0)), abs=0.01)  # damping 0.5
    assert response[-1] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("speed", [0.0, -1.0])
def test_a_car_that_does_not_drive_has_no_gains(speed: float) -> None:
    with pytest.raises(ConfigError, match="expected numbers above 0"):
        lqr(speed)


@pytest.mark.parametrize(
    ("gains", "speed"), [(Gains(p=1.2, d=0.8), 0.7), (Gains(p=4.0, d=1.2), 0.7), (Gains(p=2.0, d=1.0), 1.2)]
)
def test_the_simulated_car_overshoots_as_the_model_says(gains: Gains, speed: float) -> None:
    driven = step(gains, speed, seconds=4.0)
    time, predicted = step_response(gains, speed, 4.0)
    assert overshoot(driven.mean) == pytest.approx(overshoot(predicted), abs=0.03)
    assert damping_of(overshoot(driven.mean)) == pytest.approx(margins(gains, speed).damping, abs=0.05)
    difference = driven.mean - np.interp(driven.time, time, predicted)
    assert np.sqrt(np.mean(difference**2)) < 0.04


def test_beyond_the_gain_margin_the_simulated_car_swings_on() -> None:
    wild = Gains(p=12.0, d=12.0)
    assert not margins(wild, 1.2).stable
    late = step(wild, 1.2, seconds=4.0, cars=4).clearance[:, -120:]
    calm = step(lqr(1.2), 1.2, seconds=4.0, cars=4).clearance[:, -120:]
    assert np.nanmean(np.nanstd(late, axis=1)) > 5.0 * np.nanmean(np.nanstd(calm, axis=1))


def test_a_relay_swings_the_car_where_the_models_phase_is_half_a_turn() -> None:
    cycle = relay(0.5, cars=4, seconds=18.0)
    assert cycle is not None
    (response,) = loop(Gains(p=1.0, d=0.0), 0.5, np.array([2.0 * math.pi / cycle.period_s]))
    assert abs(math.degrees(cmath.phase(-response))) < 15.0
    assert cycle.ultimate_gain == pytest.approx(1.0 / abs(response), rel=0.2)
    gains = cycle.ziegler_nichols()
    assert gains.p == pytest.approx(0.8 * cycle.ultimate_gain)
    assert gains.d == pytest.approx(gains.p * cycle.period_s / 8.0)


def test_a_fast_car_has_no_steady_swing_by_p_alone() -> None:
    assert predicted_limit_cycle(1.0) is None
    assert relay(1.0, cars=2) is None


def test_the_states_with_gains_of_a_machine_are_found() -> None:
    (state,) = wall_gains(load_machine("wall"))
    assert (state.name, state.place) == ("follow", ("states", 0))
    assert wall_gains(load_machine("office")) == []


@pytest.mark.parametrize(
    ("p", "d", "speed"), [(20.0, 20.0, 0.3), (20.0, 10.0, 0.7), (20.0, 5.0, 1.0), (5.0, 10.0, 1.5), (2.6, 1.4, 0.7)]
)
def test_a_loop_without_phase_margin_is_never_called_damped_however_fast_it_swings(
    p: float, d: float, speed: float
) -> None:
    found = margins(Gains(p=p, d=d), speed)
    assert (found.phase_deg > 0.0) == found.stable
