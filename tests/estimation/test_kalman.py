"""The Kalman filter, against filterpy."""

import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from tral_fsm.estimation import kalman

N = 5
seeds = st.integers(0, 2**32 - 1)


def covariance(rng: np.random.Generator, n: int) -> np.ndarray:
    """A covariance whose standard deviations differ by up to a hundred."""
    root = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-2.0, 0.0, n)
    return root.T @ root


@settings(deadline=None)
@given(seed=seeds, m=st.integers(1, 3), steps=st.integers(1, 20))
def test_it_finds_what_filterpy_finds(seed: int, m: int, steps: int) -> None:
    rng = np.random.default_rng(seed)
    rival = KalmanFilter(dim_x=N, dim_z=m)
    x, P = np.zeros(N), covariance(rng, N)
    rival.x, rival.P = x.copy(), P.copy()
    for _ in range(steps):
        F, Q = np.eye(N) + 0.1 * rng.normal(size=(N, N)), covariance(rng, N)
        H, R, z = rng.normal(size=(m, N)), covariance(rng, m) + 0.01 * np.eye(m), rng.normal(size=m)
        rival.predict(F=F, Q=Q)
        rival.update(z, R=R, H=H)
        x, P = F @ x, kalman.predict(P, F, Q)
        PH, S = kalman.innovation_covariance(P, H, R)
        assert pytest.approx(rival.S, rel=1e-9) == S
        errors, P = kalman.update(P, (z - H @ x).tolist(), PH, S)
        x = x + errors
        assert pytest.approx(rival.x, rel=1e-9, abs=1e-9) == x
        assert pytest.approx(rival.P, rel=1e-9, abs=1e-9) == P


@settings(deadline=None)
@given(seed=seeds)
def test_the_covariance_stays_symmetric_and_positive_semi_definite(seed: int) -> None:
    rng = np.random.default_rng(seed)
    P = covariance(rng, N)
    for _ in range(200):
        P = kalman.predict(P, np.eye(N) + 0.1 * rng.normal(size=(N, N)), 0.01 * covariance(rng, N))
        H, R = rng.normal(size=(1, N)), np.array([[10.0 ** rng.uniform(-6.0, 0.0)]])
        _, P = kalman.update(P, rng.normal(size=1).tolist(), *kalman.innovation_covariance(P, H, R))
        assert (P == P.T).all()
        assert np.linalg.eigvalsh(P).min() > -1e-9 * np.trace(P)


def test_one_number_by_hand() -> None:
    P, H = np.diag((4.0, 1.0)), np.array([[1.0, 0.0]])
    PH, S = kalman.innovation_covariance(P, H, np.array([[4.0]]))
    x, P = kalman.update(P, (3.0,), PH, S)
    assert S.tolist() == [[8.0]]
    assert x.tolist() == [1.5, 0.0]
    assert P.tolist() == [[2.0, 0.0], [0.0, 1.0]]


@pytest.mark.parametrize(
    ("y", "accepted"), [((6.0, 0.0), True), ((6.1, 0.0), False), ((0.0, -3.1), False), ((math.nan, 0.0), False)]
)
def test_the_gate_asks_each_number(y: tuple[float, float], accepted: bool) -> None:
    assert kalman.gate_accepts(y, np.array([[4.0, 1.0], [1.0, 1.0]]), 3.0) is accepted


@given(seed=seeds, index=st.integers(0, N - 1))
def test_a_renewed_unknown_is_known_by_its_own_deviation_alone(seed: int, index: int) -> None:
    P = covariance(np.random.default_rng(seed), N)
    renewed = kalman.renew(P, index, 0.5)
    others = [k for k in range(N) if k != index]
    assert kalman.sigma(renewed, index) == 0.5
    assert not renewed[index, others].any()
    assert not renewed[others, index].any()
    assert (renewed[np.ix_(others, others)] == P[np.ix_(others, others)]).all()
