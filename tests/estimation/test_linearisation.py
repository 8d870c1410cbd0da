"""F and Q of both filters, against numeric derivatives of dead reckoning."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from readings import Feed

from tral_env.geometry import SIDE_SONAR_X_M
from tral_env.se2 import compose, relative
from tral_fsm.estimation.gate_tracker import GateTracker
from tral_fsm.estimation.odometry import Odometry, OdometrySample
from tral_fsm.estimation.readings import Readings
from tral_fsm.estimation.wall_filter import WallFilter

EPS = 1e-4
FAST_MPS = 1e6
"""At this speed the tyres' scrub holds no wheel back."""
HEADING, TRIM, GAIN, LEFT, RIGHT = range(5)
WAYS = [(0.04, 0.0), (0.04, 0.2), (0.04, -0.2), (0.2, 0.1), (-0.04, 0.2)]
"""Way [m], steering."""


class Errors(NamedTuple):
    """What is wrong with a car."""

    heading: float = 0.0
    trim: float = 0.0
    gain: float = 0.0


NONE = Errors()


def drive(way: float, steering: float, errors: Errors = NONE) -> tuple[OdometrySample, OdometrySample]:
    """Samples of dead reckoning before and after a way [m] that begins at the origin, with errors put right."""
    feed, odometry, n = Feed(), Odometry(), 20
    for k in range(300):
        # the car stands until its wheels are where they should be; then reverse gear may be in
        gear = {"speed": 0.0, "throttle": math.copysign(0.2, way)} if k == 200 else {"speed": FAST_MPS}
        row = feed.row(distance=0.0, steering=steering, **gear)
        odometry.update(Readings._make(row), errors.trim, 1.0 + errors.gain)
    odometry.correct_heading(errors.heading, 0.0, 0.0)
    before = odometry.sample_before(0.0)
    for k in range(n):
        row = feed.row(distance=abs(way) * (k + 1) / n)
        odometry.update(Readings._make(row), errors.trim, 1.0 + errors.gain)
    return before, odometry.sample_before(0.0)


def aside(sample: OdometrySample) -> float:
    """How far to the left the side ultrasonics are, m."""
    return sample.y + SIDE_SONAR_X_M * math.sin(sample.yaw)


def predicted(P: np.ndarray, way: float, steering: float) -> np.ndarray:
    """What a wall filter makes of its covariance over a way on which nothing is heard."""
    walls = WallFilter()
    before, after = drive(way, steering)
    walls.update(walls.left, 6.0, before, 0.0)
    walls.P = P.tolist()
    walls.update(walls.left, 6.0, after, 0.0)
    return np.array(walls.P)


def tracked(P: np.ndarray, way: float, steering: float, gate: tuple[float, float, float]) -> np.ndarray:
    """What a tracker makes of its covariance over a way, before a detection that is not believed."""
    before, after = drive(way, steering)
    tracker = GateTracker(*gate, before)
    tracker.P = P.tolist()
    tracker.update(1e3, 1e3, 0.0, after)
    return np.array(tracker.P)


def unit(k: int) -> np.ndarray:
    """The covariance of one unknown alone."""
    P = np.zeros((5, 5))
    P[k, k] = 1.0
    return P


class TestWalls:
    @pytest.mark.parametrize(("way", "steering"), WAYS)
    @pytest.mark.parametrize("unknown", ["heading", "trim", "gain"])
    def test_an_error_moves_heading_and_ranges_as_dead_reckoning_does(
        self, way: float, steering: float, unknown: str
    ) -> None:
        j = Errors._fields.index(unknown)
        moved = []
        for sign in (1.0, -1.0):
            before, after = drive(way, steering, Errors()._replace(**{unknown: sign * EPS}))
            moved.append((after.yaw, aside(after) - aside(before)))
        heading, left = (np.array(moved[0]) - moved[1]) / (2.0 * EPS)
        # P = e e' becomes F e e' F' + Q, and its column j is that of F
        column = (predicted(unit(j), way, steering) - predicted(np.zeros((5, 5)), way, steering))[:, j]
        assert column == pytest.approx(
            [heading, *(float(k == j) for k in (TRIM, GAIN)), -left, left], rel=0.06, abs=2e-3 * abs(way)
        )

    @pytest.mark.parametrize("unknown", [LEFT, RIGHT])
    def test_a_wrong_range_stays_as_wrong(self, unknown: int) -> None:
        Q = predicted(np.zeros((5, 5)), 0.2, 0.1)
        assert predicted(unit(unknown), 0.2, 0.1) - Q == pytest.approx(unit(unknown), abs=1e-12)

    @pytest.mark.parametrize(("way", "steering"), WAYS)
    def test_noise_is_that_of_dead_reckoning_and_of_walls_that_wander(self, way: float, steering: float) -> None:
        before, after = drive(way, steering)
        Q = predicted(np.zeros((5, 5)), way, steering)
        assert Q[HEADING, HEADING] == after.heading_noise(before) > 0.0
        assert Q[TRIM, TRIM] == after.trim_noise(before) > 0.0
        # walls wander by 1 cm in a metre; the hall sensor is wrong by 5 % over 4 cm, at a slant
        s = abs(after.arc_length - before.arc_length)
        w, d = 1e-4 * s, 0.04 * s * (0.05 * math.sin(after.yaw)) ** 2
        assert Q[3:, 3:] == pytest.approx(np.array([[w + d, -d], [-d, w + d]]), rel=1e-9, abs=1e-18)
        Q[3:, 3:] = Q[HEADING, HEADING] = Q[TRIM, TRIM] = 0.0
        assert not Q.any()


GATES = [(3.0, 0.5, 0.1), (2.0, -1.0, -0.3)]


class TestGates:
    @pytest.mark.parametrize("gate", GATES)
    @pytest.mark.parametrize(("way", "steering"), [(0.04, 0.0), (0.04, 0.2), (0.04, -0.2), (-0.04, 0.2)])
    @pytest.mark.parametrize("unknown", ["trim", "gain"])
    def test_an_error_turns_the_gate_about_the_car(
        self, gate: tuple[float, float, float], way: float, steering: float, unknown: str
    ) -> None:
        # a detection from the true pose, placed from the one of dead reckoning
        _, reckoned = drive(way, steering)
        placed = [
            compose(reckoned[:3], relative(drive(way, steering, Errors()._replace(**{unknown: e}))[1][:3], gate))
            for e in (EPS, -EPS)
        ]
        derivative = (np.array(placed[0]) - placed[1]) / (2.0 * EPS)
        j = 3 + ["trim", "gain"].index(unknown)
        column = (tracked(unit(j), way, steering, gate) - tracked(np.zeros((5, 5)), way, steering, gate))[:, j]
        # F leaves out that the way of the axle, too, depends on the curvature, by c T / 2 = 0.115 m a unit of steering,
        # and that the lever is longer at its beginning
        left_out = {"trim": 0.2, "gain": 0.05}[unknown] * abs(way)
        assert column == pytest.approx([*derivative, float(j == 3), float(j == 4)], rel=0.06, abs=left_out)

    @pytest.mark.parametrize("gate", GATES)
    def test_the_doubt_about_the_heading_turns_it_too(self, gate: tuple[float, float, float]) -> None:
        way, steering = 0.2, 0.1
        before, after = drive(way, steering)
        turned = []
        for sign in (1.0, -1.0):
            pose = after[0], after[1], after[2] + sign * EPS
            turned.append(compose(pose, relative(after[:3], gate)))
        J = (np.array(turned[0]) - turned[1]) / (2.0 * EPS)
        Q = tracked(np.zeros((5, 5)), way, steering, gate)
        w, p = after.heading_noise(before), 0.02**2 * (after.arc_length - before.arc_length)
        assert Q[:3, :3] == pytest.approx(w * np.outer(J, J) + np.diag((p, p, 0.0)), rel=1e-6)
        assert Q[3, 3] == after.trim_noise(before)
        assert not Q[3:, :3].any()
        assert Q[4, 4] == Q[3, 4] == 0.0
