import numpy as np
import pytest
from marker_world import build

from tral_env.config import WIDE_LENS, CameraConfig
from tral_env.errors import ConfigError
from tral_env.perception.aruco import Detector, MarkerCorners, marker_poses
from tral_env.perception.camera import OnboardCamera

FACING = np.pi
"""A normal that points back along x."""


def look(world, lens=None, mounting=(0.0, 0.0, 0.0)):
    lens = lens or CameraConfig()
    camera = OnboardCamera(lens)
    return marker_poses(Detector().detect(camera.capture(world.model, world.data, mounting)), lens)


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("distance", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
def test_a_marker_is_placed_within_three_percent(distance):
    poses = look(build([(7, distance, 0.1 * distance, 0.2, FACING)]))
    assert poses.ids.tolist() == [7]
    error = np.hypot(poses.x[0] - distance, poses.y[0] - 0.1 * distance)
    assert error < 0.03 * distance


@pytest.mark.usefixtures("opengl")
def test_the_wide_lens_places_a_marker_within_three_percent():
    poses = look(build([(7, 1.7, -0.9, 0.25, FACING)]), WIDE_LENS)
    assert poses.ids.tolist() == [7]
    assert np.hypot(poses.x[0] - 1.7, poses.y[0] + 0.9) < 0.03 * 1.9


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("side", [0.4, -0.4])
def test_left_is_positive(side):
    poses = look(build([(3, 2.0, side, 0.2, FACING)]))
    assert poses.y[0] == pytest.approx(side, abs=0.03)


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("turn", [-0.6, -0.3, 0.3, 0.6])
def test_heading_is_the_direction_into_the_marker(turn):
    poses = look(build([(3, 1.5, 0.1, 0.2, FACING + turn)]))
    assert poses.heading[0] == pytest.approx(turn, abs=0.03)


@pytest.mark.usefixtures("opengl")
def test_heading_is_counted_from_the_car():
    world = build([(3, 1.5, 0.0, 0.2, FACING)])
    world.put_car(0.0, 0.0, 0.2)
    poses = look(world)
    assert poses.heading[0] == pytest.approx(-0.2, abs=0.05)
    assert poses.y[0] < 0


@pytest.mark.usefixtures("opengl")
def test_the_estimator_does_not_know_the_mounting_error():
    poses = look(build([(3, 2.2, 0.0, 0.2, FACING)]), mounting=(0.0, 0.0, 0.05))
    assert poses.y[0] == pytest.approx(-0.05 * 2.0, abs=0.02)


@pytest.mark.usefixtures("opengl")
def test_a_good_view_has_a_small_reprojection_error():
    assert look(build([(3, 1.5, 0.1, 0.2, FACING + 0.4)])).error_px[0] < 0.3


@pytest.mark.usefixtures("opengl")
def test_a_mirrored_marker_is_not_found():
    assert look(build([(7, 1.5, 0.0, 0.2, FACING)], mirrored=True)).ids.size == 0


@pytest.mark.usefixtures("opengl")
def test_a_marker_seen_from_behind_is_not_found():
    assert look(build([(7, 1.5, 0.0, 0.2, 0.0)])).ids.size == 0


@pytest.mark.usefixtures("opengl")
def test_a_hidden_marker_is_not_found():
    assert look(build([(7, 3.0, 0.0, 0.2, FACING)], [(2.0, 0.0, 0.2, 0.0, 0.05, 0.02, 0.2)])).ids.size == 0


def test_an_empty_image_has_no_markers():
    poses = marker_poses(Detector().detect(np.zeros((48, 64), np.uint8)), CameraConfig())
    assert poses.ids.shape == poses.x.shape == poses.heading.shape == (0,)


def test_an_image_of_another_kind_is_refused():
    with pytest.raises(ConfigError, match=r"shape \(48, 64, 4\), uint8"):
        Detector().detect(np.zeros((48, 64, 4), np.uint8))


@pytest.mark.parametrize("turn", [-0.5, 0.0, 0.5])
def test_exact_corners_give_the_exact_pose(turn):
    lens = CameraConfig()
    half = lens.marker_size / 2
    # Camera axes: x right, y down, z forward; the printed corners from the upper left one round.
    right = np.array([np.cos(turn), 0.0, np.sin(turn)]) * half
    down = np.array([0.0, half, 0.0])
    corners = np.array([-right - down, right - down, right + down, -right + down]) + np.array([0.3, 0.1, 2.0])
    pixels = corners[:, :2] / corners[:, 2:] * lens.fx + np.array([lens.cx, lens.cy])
    poses = marker_poses(MarkerCorners(np.array([5]), pixels[None]), lens)
    assert (poses.x[0], poses.y[0]) == pytest.approx((2.2, -0.3), abs=1e-6)
    assert poses.heading[0] == pytest.approx(turn, abs=1e-4)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((10, 10), np.float32),
        np.zeros((10, 10, 3), np.float32),
        np.zeros((10, 10, 3), np.int64),
        np.zeros((0, 10), np.uint8),
        np.zeros((10, 0, 3), np.uint8),
        np.zeros((10, 10, 4), np.uint8),
        np.zeros((2, 10, 10, 3), np.uint8),
        np.zeros(10, np.uint8),
        None,
    ],
)
def test_what_is_no_image_is_refused(image):
    with pytest.raises(ConfigError, match=r"Allowed: \(h, w\) or \(h, w, 3\), uint8"):
        Detector().detect(image)
