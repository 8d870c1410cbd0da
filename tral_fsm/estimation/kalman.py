"""The Kalman filter of errors, with the symbols of the book.

    predict:   P = F P F' + Q
    update:    S = H P H' + R          K = P H' / S          x = K y          P = P - K (P H')'

x are n unknowns and P is their covariance. F says how they move, and Q is the doubt that this adds. The innovation y is
by how much m measured numbers differ from the predicted ones. H says what these are of the unknowns, and R is their
covariance. S is the covariance of the innovation, K the gain.

Both filters of this project estimate by how much something is wrong, and put it right at once: so x is 0 before an
update, and K y after it. Source: Welch and Bishop, An Introduction to the Kalman Filter, 2006; Sola, Quaternion
kinematics for the error-state Kalman filter, 2017, section 6.

`dot` stands for `@`, which takes twice as long on matrices so small.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_HALF = np.array(0.5)


def predict(P: Array, F: Array, Q: Array) -> Array:
    """P = F P F' + Q.

    Args:
        P: (n, n) covariance.
        F: (n, n) how the unknowns move.
        Q: (n, n) covariance that this adds.
    """
    predicted: Array = F.dot(P).dot(F.T) + Q
    return predicted


def innovation_covariance(P: Array, H: Array, R: Array) -> tuple[Array, Array]:
    """P H' (n, m), and S = H P H' + R (m, m).

    Args:
        P: (n, n) covariance.
        H: (m, n) what the measured numbers are of the unknowns.
        R: (m, m) their covariance.
    """
    PH = P.dot(H.T)
    return PH, H.dot(PH) + R


def gate_accepts(y: Sequence[float], S: Array, sigmas: float) -> bool:
    """Whether each innovation lies within so many standard deviations; NaN does not.

    Args:
        y: (m,) innovations.
        S: (m, m) their covariance.
        sigmas: how many.
    """
    limit = sigmas * sigmas
    for each, variance in zip(y, S.diagonal().tolist(), strict=True):  # noqa: SIM110 (`all` takes twice as long)
        if not each * each <= limit * variance:
            return False
    return True


def update(P: Array, y: Sequence[float], PH: Array, S: Array) -> tuple[Array, Array]:
    """K = P H' / S; x = K y; P = P - K (P H')', made symmetric again.

    Args:
        P: (n, n) covariance.
        y: (m,) innovations.
        PH: (n, m) P H'.
        S: (m, m) covariance of the innovations.

    Returns:
        x (n,): what is to be added to the unknowns; P.
    """
    K = PH.dot(1.0 / S if len(S) == 1 else np.linalg.inv(S))  # one number needs no solver
    P = P - K.dot(PH.T)
    return K.dot(y), (P + P.T) * _HALF


def renew(P: Array, index: int, sigma: float) -> Array:
    """P where one unknown is known by this standard deviation only, and by no other unknown."""
    P = P.copy()
    P[index, :] = P[:, index] = 0.0
    P[index, index] = sigma * sigma
    return P


def sigma(P: Array, index: int) -> float:
    """Standard deviation of one unknown."""
    return math.sqrt(P[index, index])
