"""The physics' time step against one ten times as fine: drives of 10 s under recorded commands on a bare floor."""

from functools import cache

import numpy as np
from bare_floor import DrivenCar, floor_model

from tral_env.interface import CONTROL_PERIOD_S

TICKS = 800
REFERENCE_STEP_S = 0.00025
HARD = range(6)
"""Recordings of steering steps up to the lock, every 0.5 s, at speeds that change every second up to 1.9 m/s."""


def commands(recording: int | str) -> np.ndarray:
    """(800, 2): hard driving by number, or a gentle slalom at 1 m/s."""
    if recording == "slalom":
        return np.stack([0.3 * np.sin(np.arange(TICKS) / 40), np.full(TICKS, 0.5)], axis=1)
    rng = np.random.default_rng(recording)
    throttle = np.repeat(rng.uniform(0.3, 0.85, 10), 80)
    steering = np.repeat(rng.uniform(-1, 1, 20), 40) * np.minimum(1.0, 0.45 / throttle) ** 2
    return np.stack([steering, throttle], axis=1)


@cache
def path(recording: int | str, step_s: float | None = None) -> np.ndarray:
    """(800, 4): x, y [m], yaw [rad], speed [m/s] after each tick."""
    model = floor_model()
    model.opt.timestep = step_s or model.opt.timestep
    car, out = DrivenCar(model), []
    for steering, throttle in commands(recording):
        car.drive(steering, throttle, CONTROL_PERIOD_S)
        out.append((*car.position[:2], car.yaw, car.speeds[-1]))
    return np.array(out)


def errors(recording: int | str) -> tuple[float, float]:
    """Largest error of place [m] and of heading [deg] in a drive."""
    ours, fine = path(recording), path(recording, REFERENCE_STEP_S)
    turned = (ours[:, 2] - fine[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return float(np.hypot(*(ours - fine)[:, :2].T).max()), float(np.degrees(np.abs(turned).max()))


def test_the_recordings_reach_almost_two_metres_a_second():
    assert max(path(recording, REFERENCE_STEP_S)[:, 3].max() for recording in HARD) > 1.85


def test_an_ordinary_drive_ends_within_a_centimetre_and_a_tenth_of_a_degree():
    place, heading = errors("slalom")
    assert place < 0.01
    assert heading < 0.1


def test_hard_drives_stay_within_a_centimetre_but_for_one_at_the_limit_of_the_tyres():
    place, heading = np.transpose([errors(recording) for recording in HARD])
    assert np.median(place) < 0.008
    assert np.sum(place < 0.01) >= 5
    assert place.max() < 0.02
    assert heading.max() < 0.25
