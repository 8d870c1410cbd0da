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


def entries(matrix: np.ndarray) -> list[kalman.Entry]:
    """Row, column and value of what is not 0."""
    return [(int(i), int(j), float(matrix[i, j])) for i, j in np.argwhere(matrix)]


@settings(deadline=None)
@given(seed=seeds, m=st.integers(1, 3), steps=st.integers(1, 20))
def test_it_finds_what_filterpy_finds(seed: int, m: int, steps: int) -> None:
    rng = np.random.default_rng(seed)
    rival = KalmanFilter(dim_x=N, dim_z=m)
    x, P = np.zeros(N), covariance(rng, N)
    rival.x, rival.P = x.copy(), P.copy()
    for _ in range(steps):
        F, Q = np.eye(N) + 0.1 * rng.normal(size=(N, N)), covariance(rng, N)
        H, R, z = rng.normal(size=(m, N)), 10.0 ** rng.uniform(-2.0, 0.0, m), rng.normal(size=m)
        rival.predict(F=F, Q=Q)
        rival.update(z, R=np.diag(R), H=H)
        x, P = F @ x, kalman.predict(P, entries(F - np.eye(N)), entries(np.triu(Q)))
        S = [kalman.innovation(P, h, r)[1] for h, r in zip(H, R, strict=True)]
        assert pytest.approx(rival.S.diagonal(), rel=1e-9) == S
        errors, P = kalman.update_each(P, z - H @ x, H, R)
        x = x + errors
        assert pytest.approx(rival.x, rel=1e-9, abs=1e-9) == x
        assert pytest.approx(rival.P, rel=1e-9, abs=1e-9) == np.array(P)


@settings(deadline=None)
@given(seed=seeds)
def test_the_covariance_stays_symmetric_and_positive_semi_definite(seed: int) -> None:
    rng = np.random.default_rng(seed)
    P = covariance(rng, N)
    for _ in range(200):
        P = kalman.predict(P, entries(0.1 * rng.normal(size=(N, N))), entries(np.triu(0.01 * covariance(rng, N))))
        h, r = rng.normal(size=N).tolist(), 10.0 ** rng.uniform(-6.0, 0.0)
        _, P = kalman.update(P, float(rng.normal()), *kalman.innovation(P, h, r))
        matrix = np.array(P)
        assert (matrix == matrix.T).all()
        assert np.linalg.eigvalsh(matrix).min() > -1e-9 * np.trace(matrix)


def test_one_number_by_hand() -> None:
    P, h = kalman.diagonal((2.0, 1.0, 1.0, 1.0, 1.0)), (1.0, 0.0, 0.0, 0.0, 0.0)
    Ph, S = kalman.innovation(P, h, 4.0)
    x, P = kalman.update(P, 3.0, Ph, S)
    assert S == 8.0
    assert list(x) == [1.5, 0.0, 0.0, 0.0, 0.0]
    assert (np.array(P) == np.diag((2.0, 1.0, 1.0, 1.0, 1.0))).all()


def test_a_way_by_hand() -> None:
    # the first unknown moves by half of the second, whose variance is 4
    P = kalman.predict(kalman.diagonal((1.0, 2.0, 1.0, 1.0, 1.0)), [(0, 1, 0.5)], [(0, 0, 0.25), (3, 4, 0.125)])
    expected = np.diag((2.25, 4.0, 1.0, 1.0, 1.0))
    expected[0, 1] = expected[1, 0] = 2.0
    expected[3, 4] = expected[4, 3] = 0.125
    assert (np.array(P) == expected).all()


@pytest.mark.parametrize(("y", "accepted"), [(6.0, True), (6.1, False), (-6.1, False), (math.nan, False)])
def test_the_gate_accepts_so_many_standard_deviations(y: float, accepted: bool) -> None:
    assert kalman.gate_accepts(y, 4.0, 3.0) is accepted


@given(seed=seeds, index=st.integers(0, N - 1))
def test_a_renewed_unknown_is_known_by_its_own_deviation_alone(seed: int, index: int) -> None:
    P = covariance(np.random.default_rng(seed), N)
    renewed = kalman.renew(P, index, 0.5)
    others = [k for k in range(N) if k != index]
    assert kalman.sigma(renewed, index) == 0.5
    renewed = np.array(renewed)
    assert not renewed[index, others].any()
    assert not renewed[others, index].any()
    assert (renewed[np.ix_(others, others)] == P[np.ix_(others, others)]).all()
