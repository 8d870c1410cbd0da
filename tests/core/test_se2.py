"""Poses in the plane: one law for floats and for arrays."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env import se2

metres, angles = st.floats(-50.0, 50.0), st.floats(-100.0, 100.0)
poses = st.tuples(metres, metres, angles)


def test_a_point_ahead_of_a_frame_that_looks_left_lies_left_of_its_origin() -> None:
    assert se2.to_outer((1.0, 2.0, math.pi / 2), 3.0, 0.0) == pytest.approx((1.0, 5.0))
    assert se2.to_inner((1.0, 2.0, math.pi / 2), 1.0, 5.0) == pytest.approx((3.0, 0.0))


def test_a_quarter_turn_is_exact_where_its_cosine_is() -> None:
    assert se2.rotate(0, 1, 0.3, 0.1) == (-0.1, 0.3)


def test_turning_back_undoes_a_quarter_turn() -> None:
    assert se2.rotate_back(0, 1, -0.1, 0.3) == (0.3, 0.1)


def test_half_a_turn_wraps_to_the_lower_end() -> None:
    assert se2.wrap(math.pi) == -math.pi
    assert se2.wrap(-math.pi) == -math.pi
    assert se2.wrap(math.nextafter(-math.pi, -4.0)) == math.pi


@given(angles)
def test_wrapped_angles_keep_their_direction(angle: float) -> None:
    wrapped = se2.wrap(angle)
    assert -math.pi <= wrapped <= math.pi
    assert (math.cos(wrapped), math.sin(wrapped)) == pytest.approx((math.cos(angle), math.sin(angle)), abs=1e-9)


@given(st.lists(angles, max_size=8))
def test_an_array_wraps_as_each_of_its_floats_does(many: list[float]) -> None:
    assert se2.wrap(np.array(many)).tolist() == [se2.wrap(angle) for angle in many]


@given(poses, poses)
def test_relative_undoes_compose(frame: se2.Pose, pose: se2.Pose) -> None:
    x, y, yaw = se2.relative(frame, se2.compose(frame, pose))
    assert (x, y) == pytest.approx(pose[:2], abs=1e-9)
    assert se2.wrap(yaw - pose[2]) == pytest.approx(0.0, abs=1e-9)


@given(poses, poses, poses)
def test_it_does_not_matter_which_of_two_frames_is_composed_first(a: se2.Pose, b: se2.Pose, c: se2.Pose) -> None:
    assert se2.compose(se2.compose(a, b), c) == pytest.approx(se2.compose(a, se2.compose(b, c)), abs=1e-9)


@given(st.lists(st.tuples(poses, metres, metres), min_size=1, max_size=8))
def test_arrays_are_transformed_as_each_of_their_floats_is(many: list[tuple[se2.Pose, float, float]]) -> None:
    frames, points = np.array([frame for frame, *_ in many]), np.array([point for _, *point in many])
    outer = [se2.to_outer(frame, x, y) for frame, x, y in many]
    turned = [se2.to_outer((0.0, 0.0, frame[2]), x, y) for frame, x, y in many]
    np.testing.assert_allclose(se2.to_outer_n(frames, points), outer, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(se2.rotate_n(frames[:, 2], points), turned, rtol=0.0, atol=1e-12)
