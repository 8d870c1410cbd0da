"""The Kalman filter of errors, with the symbols of the book.

    predict:   P = F P F' + Q
    update:    S = h P h' + r          K = P h' / S          x = K y          P = P - K (P h')'

x are the unknowns and P is their covariance. F says how they move, and Q is the doubt that this adds. The innovation y
is by how much a measured number differs from the predicted one. h says what the number is of the unknowns, and r is its
variance. S is the variance of the innovation, K the gain. Numbers whose errors are independent are taken one after the
other, h being a row of the book's H and r a place on the diagonal of its R: the result is that of all at once, and no
matrix is inverted.

Both filters of this project estimate by how much something is wrong, and put it right at once: so x is 0 before an
update, and K y after it. Source: Welch and Bishop, An Introduction to the Kalman Filter, 2006; Simon, Optimal State
Estimation, 2006, section 6.1 (one number after the other); Sola, Quaternion kinematics for the error-state Kalman
filter, 2017, section 6.

Both filters have five unknowns, and F and Q are nearly empty. So a matrix is five rows of five plain floats, F and Q
are lists of their entries, and a step takes half as long as with NumPy. No step depends on how a linear algebra library
rounds on one processor or another.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

Row = Sequence[float]
"""A number for each of five unknowns."""
Matrix = Sequence[Row]
"""Five rows."""
Entry = tuple[int, int, float]
"""Row, column and value of one entry of a matrix."""
ZERO: Row = (0.0, 0.0, 0.0, 0.0, 0.0)


def diagonal(sigmas: Row) -> Matrix:
    """The covariance of unknowns of these standard deviations that do not depend on each other."""
    return [_unit(k, sigma * sigma) for k, sigma in enumerate(sigmas)]


def _unit(index: int, value: float) -> Row:
    return [value if k == index else 0.0 for k in range(5)]


def _moved(F: Sequence[Entry], M: Sequence[Row]) -> list[Row]:
    """F M."""
    moved = list(M)
    for row, column, f in F:
        a, b, c, d, e = moved[row]
        p, q, r, s, t = M[column]
        moved[row] = a + f * p, b + f * q, c + f * r, d + f * s, e + f * t
    return moved


def predict(P: Matrix, F: Sequence[Entry], Q: Sequence[Entry]) -> Matrix:
    """P = F P F' + Q, as F (F P)' + Q, since P is symmetric.

    Args:
        P: covariance.
        F: how the unknowns move: the entries by which F differs from the identity.
        Q: covariance that this adds: its entries that are not 0, on the diagonal and above it.
    """
    FP = _moved(F, P)
    predicted = [list(row) for row in _moved(F, list(zip(*FP, strict=True)))]
    for row, column, q in Q:
        predicted[row][column] += q
    return _mirrored(predicted)


def _mirrored(P: Matrix) -> Matrix:
    """P with what stands above the diagonal also below it: rounding would make them differ."""
    (a, b, c, d, e), (_, f, g, h, i), (_, _, j, k, m), (_, _, _, n, o), (_, _, _, _, p) = P
    return [(a, b, c, d, e), (b, f, g, h, i), (c, g, j, k, m), (d, h, k, n, o), (e, i, m, o, p)]


def dot(h: Row, x: Row) -> float:
    """h x."""
    return h[0] * x[0] + h[1] * x[1] + h[2] * x[2] + h[3] * x[3] + h[4] * x[4]


def innovation(P: Matrix, h: Row, r: float) -> tuple[Row, float]:
    """P h', and S = h P h' + r.

    Args:
        P: covariance.
        h: what the measured number is of the unknowns.
        r: its variance.
    """
    p, q, r_, s, t = h
    Ph = [a * p + b * q + c * r_ + d * s + e * t for a, b, c, d, e in P]
    return Ph, dot(h, Ph) + r


def gate_accepts(y: float, S: float, sigmas: float) -> bool:
    """Whether an innovation lies within so many standard deviations; NaN does not.

    Args:
        y: innovation.
        S: its variance.
        sigmas: how many.
    """
    return y * y <= sigmas * sigmas * S


def update(P: Matrix, y: float, Ph: Row, S: float) -> tuple[Row, Matrix]:
    """K = P h' / S; x = K y; P = P - K (P h')', computed on the diagonal and above it, since P is symmetric.

    Args:
        P: covariance.
        y: innovation.
        Ph: P h'.
        S: variance of the innovation.

    Returns:
        x: what is to be added to the unknowns; P.
    """
    (a, b, c, d, e), (_, f, g, h, i), (_, _, j, k, m), (_, _, _, n, o), (_, _, _, _, u) = P
    p, q, r, s, t = Ph
    kp, kq, kr, ks, kt = p / S, q / S, r / S, s / S, t / S  # K
    b, c, d, e = b - kp * q, c - kp * r, d - kp * s, e - kp * t
    g, h, i = g - kq * r, h - kq * s, i - kq * t
    k, m, o = k - kr * s, m - kr * t, o - ks * t
    updated = (
        (a - kp * p, b, c, d, e),
        (b, f - kq * q, g, h, i),
        (c, g, j - kr * r, k, m),
        (d, h, k, n - ks * s, o),
        (e, i, m, o, u - kt * t),
    )
    return (kp * y, kq * y, kr * y, ks * y, kt * y), updated


def update_each(P: Matrix, y: Sequence[float], H: Sequence[Row], R: Sequence[float]) -> tuple[Row, Matrix]:
    """Update by several numbers whose errors are independent, one after the other.

    Args:
        P: covariance.
        y: innovations.
        H: what each number is of the unknowns.
        R: their variances.

    Returns:
        x: what is to be added to the unknowns; P.
    """
    x = ZERO
    for each, h, r in zip(y, H, R, strict=True):
        (a, b, c, d, e), P = update(P, each - dot(h, x), *innovation(P, h, r))
        x = x[0] + a, x[1] + b, x[2] + c, x[3] + d, x[4] + e
    return x, P


def renew(P: Matrix, index: int, sigma: float) -> Matrix:
    """P where one unknown is known by this standard deviation only, and by no other unknown."""
    renewed = [list(row) for row in P]
    for row in renewed:
        row[index] = 0.0
    return [_unit(index, sigma * sigma) if k == index else row for k, row in enumerate(renewed)]


def sigma(P: Matrix, index: int) -> float:
    """Standard deviation of one unknown."""
    return math.sqrt(P[index][index])
