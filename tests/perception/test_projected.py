from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from marker_world import build, plan_of

from tral_env.config import WIDE_LENS, CameraConfig, CarConfig
from tral_env.perception.aruco import Detector, marker_poses
from tral_env.perception.camera import OnboardCamera
from tral_env.perception.detection_model import DETECTION_MODEL, DetectionModel
from tral_env.perception.gate import nearest_gate_and_marker
from tral_env.perception.lens import project_points
from tral_env.perception.projected import (
    NOISE_PLACES,
    NORMALS,
    UNIFORMS,
    Scenery,
    project,
)

LENS, CAR = CameraConfig(), CarConfig()
NEVER = (0.0,) * len(DETECTION_MODEL.levels)
EXACT = DetectionModel(
    always_found=1.0,
    size_bias_px=NEVER,
    size_noise_px=NEVER,
    bearing_noise_px=NEVER,
    heading_noise_px=NEVER,
    flip_px=NEVER,
)
FACING = np.pi


def see(
    markers,
    boxes=None,
    pose=(0.0, 0.0, 0.0),
    mounting=(0.0, 0.0, 0.0),
    lens=LENS,
    model=EXACT,
    chance=0.5,
    noise=0,
    level=0.0,
):
    scenery = Scenery(1)
    scenery.place(0, plan_of(markers, boxes))
    return project(
        scenery,
        np.array([0]),
        np.array([pose]),
        lens,
        CAR,
        mounting=np.array([mounting]),
        normal=np.full((1, NOISE_PLACES, NORMALS), float(noise)),
        uniform=np.full((1, NOISE_PLACES, UNIFORMS), chance),
        degradation=np.array([level]),
        model=model,
    )


@given(st.floats(0.8, 4), st.floats(-0.35, 0.35), st.floats(0.15, 0.3), st.floats(-1.0, 1.0), st.floats(-3, 3))
def test_without_noise_a_marker_is_where_it_is(distance, bearing, height, turn, yaw):
    x, y = distance * np.cos(bearing) + CAR.camera_x, distance * np.sin(bearing)
    cos, sin = np.cos(yaw), np.sin(yaw)
    marker = (3, 1 + x * cos - y * sin, 2 + x * sin + y * cos, height, FACING + bearing + turn + yaw)
    seen = see([marker], pose=(1.0, 2.0, yaw))
    assert seen.valid[0, 0]
    assert (seen.x[0, 0], seen.y[0, 0]) == pytest.approx((x, y), abs=1e-9)
    assert seen.heading[0, 0] == pytest.approx(bearing + turn, abs=1e-9)


@pytest.mark.parametrize(
    "marker",
    [
        pytest.param((3, -2.0, 0.0, 0.2, 0.0), id="behind the car"),
        pytest.param((3, 2.0, 0.0, 0.2, 0.0), id="from behind"),
        pytest.param((3, 2.0, 1.3, 0.2, FACING), id="beside the image"),
        pytest.param((3, 1.0, 0.0, 0.6, FACING), id="above the image"),
        pytest.param((3, 2.0, 0.0, 0.2, FACING + 1.5), id="edge on"),
        pytest.param((3, 14.0, 0.0, 0.2, FACING), id="too far"),
    ],
)
def test_a_marker_is_not_seen(marker):
    assert not see([marker]).valid.any()


@pytest.mark.parametrize(
    ("box", "seen"),
    [
        pytest.param((2.0, 0.0, 0.2, 0.3, 0.1, 0.1, 0.2), False, id="in between"),
        pytest.param((2.0, 0.1, 0.2, 0.0, 0.01, 0.07, 0.2), False, id="before one corner"),
        pytest.param((2.0, 0.5, 0.2, 0.0, 0.1, 0.1, 0.2), True, id="beside"),
        pytest.param((2.0, 0.0, 0.02, 0.0, 0.1, 0.1, 0.02), True, id="low"),
        pytest.param((3.06, 0.0, 0.2, 0.0, 0.05, 0.12, 0.2), True, id="the post that carries it"),
        pytest.param((4.0, 0.0, 0.2, 0.0, 0.1, 0.1, 0.2), True, id="behind it"),
        pytest.param((-1.0, 0.0, 0.2, 0.0, 0.1, 0.1, 0.2), True, id="behind the car"),
        pytest.param((2.0, 0.6, 0.5, 0.0, 4.0, 0.05, 0.5), True, id="a wall along"),
        pytest.param((2.0, 0.0, 0.5, np.pi / 2, 4.0, 0.05, 0.5), False, id="a wall across"),
    ],
)
def test_a_box_hides_a_marker_only_from_in_between(box, seen):
    assert see([(3, 3.0, 0.0, 0.2, FACING)], [box]).valid[0, 0] == seen


def test_of_all_markers_of_a_size_the_model_s_share_is_found():
    model = DetectionModel(
        always_found=1.0, weakness=(), half_found_px=(LENS.fx * LENS.marker_size / 5.0,) * len(DETECTION_MODEL.levels)
    )
    marker = (3, 5.0 + CAR.camera_x, 0.0, CAR.camera_z, FACING)
    assert see([marker], model=model, chance=0.49).valid[0, 0]
    assert not see([marker], model=model, chance=0.51).valid[0, 0]


def test_a_mounting_error_turns_what_is_seen():
    seen = see([(3, 2.2, 0.0, CAR.camera_z, FACING)], mounting=(0.0, 0.0, 0.05))
    assert seen.y[0, 0] == pytest.approx(-2.0 * np.sin(0.05))
    assert seen.heading[0, 0] == pytest.approx(-0.05)


def test_noise_grows_as_the_marker_gets_smaller():
    near, far = (
        abs(see([(3, d, 0.0, 0.2, FACING)], model=DetectionModel(), noise=1).x[0, 0] - d) / d for d in (1.0, 4.0)
    )
    assert far > 3 * near


def test_noise_grows_with_the_level_of_degradation():
    marker = (3, 4.0, 0.0, 0.2, FACING)
    x, y = zip(
        *(
            (seen.x[0, 0], abs(seen.y[0, 0]))
            for seen in (see([marker], model=DETECTION_MODEL, noise=1, level=i) for i in range(4))
        ),
        strict=True,
    )
    assert list(x) == sorted(x)
    assert list(y) == sorted(y)


def test_without_noise_blurred_markers_seem_farther():
    marker = (3, 4.0, 0.0, 0.2, FACING)
    clean, strong = (see([marker], model=DETECTION_MODEL, level=level).x[0, 0] for level in (0.0, 3.0))
    assert 0.01 < strong / clean - 1 < 0.05


def test_between_the_levels_the_model_s_figures_are_interpolated():
    model = DetectionModel(levels=(0.0, 2.0), half_found_px=(8.0, 12.0))
    assert model.at(model.half_found_px, np.array([0.0, 0.5, 2.0, 9.0])).tolist() == [8.0, 9.0, 12.0, 12.0]


def test_weak_codes_need_larger_images_the_more_so_the_more_blurred():
    chance = DETECTION_MODEL.found(np.full(4, 17.5), np.array([0, 9, 2, 42]), np.full(4, 3.0), 640)
    assert chance[2] == pytest.approx(DETECTION_MODEL.always_found / 2)
    assert (np.diff(chance) > 0.05).all()


@pytest.mark.parametrize("level", [0.0, 3.0])
@pytest.mark.parametrize(("width", "least"), [(640, 4.8), (1280, 9.6), (1920, 14.4)])
def test_markers_too_small_for_opencv_are_never_found_and_large_ones_are(width, least, level):
    sizes = np.array([0.0, least - 0.01, 60.0])
    nothing, small, large = DETECTION_MODEL.found(sizes, np.full(3, 2), np.full(3, level), width)
    assert nothing == small == 0.0
    assert large == pytest.approx(DETECTION_MODEL.always_found, abs=1e-6)


def test_a_far_marker_s_heading_may_be_mirrored():
    marker = (3, 5.0, 0.0, CAR.camera_z, FACING + 0.3)
    assert see([marker], model=DetectionModel(heading_noise_px=NEVER), noise=3).heading[0, 0] == pytest.approx(
        -0.3, abs=0.02
    )


@settings(max_examples=30)
@given(st.floats(-1, 1), st.floats(-0.7, 0.7), st.sampled_from([LENS, WIDE_LENS]))
def test_points_are_projected_as_opencv_does(right, down, lens):
    cv2 = pytest.importorskip("cv2")
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
    theirs, _ = cv2.projectPoints(
        np.array([[right, down, 1.0]]), np.zeros(3), np.zeros(3), matrix, np.array(lens.distortion)
    )
    ours = project_points(np.array([1.0, -right, -down]), lens)
    assert ours == pytest.approx(theirs.ravel(), abs=1e-9)


def test_what_lies_beyond_the_lens_s_edge_is_not_folded_into_the_image():
    assert np.isnan(project_points(np.array([1.0, 4.0, 0.0]), WIDE_LENS)).any()
    assert np.isnan(project_points(np.array([-1.0, 0.0, 0.0]), LENS)).all()


def crowd(n, seed=0):
    rng = np.random.default_rng(seed)
    scenery = Scenery(n)
    for row in range(n):
        gates = rng.uniform(1.5, 9, 3)
        markers = [
            (2 * k + side, x, 0.5 - side, 0.2, FACING + rng.uniform(-0.2, 0.2))
            for k, x in enumerate(gates)
            for side in (0, 1)
        ]
        boxes = [
            (rng.uniform(-3, 12), rng.choice([-1.2, 1.2]), 0.5, 0.0, rng.uniform(0.1, 1.5), 0.05, 0.5)
            for _ in range(int(rng.integers(10, 60)))
        ]
        boxes += [(rng.uniform(1, 9), rng.uniform(-1, 1), 0.2, rng.uniform(-3, 3), 0.1, 0.15, 0.2) for _ in range(3)]
        scenery.place(row, plan_of(markers, boxes))
    inputs = {
        "mounting": rng.normal(0, 0.02, (n, 3)),
        "normal": rng.standard_normal((n, NOISE_PLACES, NORMALS)),
        "uniform": rng.random((n, NOISE_PLACES, UNIFORMS)),
        "degradation": rng.uniform(0, 3.5, n),
    }
    return scenery, rng.uniform([0, -0.4, -0.3], [3, 0.4, 0.3], (n, 3)), inputs


@pytest.mark.parametrize("lens", [LENS, WIDE_LENS], ids=["default", "wide"])
def test_a_row_has_the_same_bits_in_any_batch(lens):
    n = 64
    scenery, pose, inputs = crowd(n)
    together = project(scenery, np.arange(n), pose, lens, CAR, **inputs)
    assert 0.2 < together.valid.mean() < 0.9
    for size in (1, 5):
        for start in range(0, n - size + 1, size):
            rows = np.arange(start, start + size)
            alone = project(scenery, rows, pose[rows], lens, CAR, **{k: v[rows] for k, v in inputs.items()})
            for name, values in vars(together).items():
                assert (getattr(alone, name) == values[rows]).all(), name


def test_a_row_has_the_same_bits_when_a_larger_course_comes_in_beside_it():
    scenery, pose, inputs = crowd(2)
    before = project(scenery, np.arange(2), pose, LENS, CAR, **inputs)
    many = [(i % 40, 3.0 + i, 0.0, 0.2, FACING) for i in range(20)]
    scenery.place(1, plan_of(many, [(5.0 + i, 1.0, 0.5, 0.0, 0.5, 0.05, 0.5) for i in range(90)]))
    after = project(scenery, np.arange(2), pose, LENS, CAR, **inputs)
    for name in ("x", "y", "heading", "valid"):
        assert (getattr(after, name)[0, :6] == getattr(before, name)[0]).all(), name
    assert not after.valid[0, 6:].any()


def views(count):
    """Random views of a turned gate and an obstacle, rendered and projected: id -> x, y, heading of each."""
    camera, detector = OnboardCamera(), Detector()
    rng = np.random.default_rng(7)
    for _ in range(count):
        x, axis, width = rng.uniform(1.5, 6), rng.uniform(-0.3, 0.3), rng.uniform(0.8, 1.3)
        side = np.array([-np.sin(axis), np.cos(axis)]) * width / 2
        markers = [
            (2, x + side[0], side[1], 0.2, axis + FACING),
            (3, x - side[0], -side[1], 0.22, axis + FACING),
        ]
        boxes = [(rng.uniform(0.8, 5), rng.uniform(-0.8, 0.8), 0.15, rng.uniform(-3, 3), 0.1, 0.1, 0.15)]
        pose = rng.uniform(-0.3, 0.3, 3)
        world = build(markers, boxes)
        world.put_car(*pose)
        poses = marker_poses(detector.detect(camera.capture(world.model, world.data)), LENS)
        seen = see(markers, boxes, pose=tuple(pose))
        truth = {
            int(i): (a, b, c)
            for i, a, b, c, ok in zip(seen.ids[0], seen.x[0], seen.y[0], seen.heading[0], seen.valid[0], strict=True)
            if ok
        }
        found = zip(poses.ids, poses.x, poses.y, poses.heading, strict=True)
        yield {int(i): (a, b, c) for i, a, b, c in found}, truth


@pytest.mark.usefixtures("opengl")
def test_projected_and_rendered_camera_agree():
    pairs = list(views(30))
    expected = sum(len(truth) for _, truth in pairs)
    differing = sum(len(set(found) ^ set(truth)) for found, truth in pairs)
    assert expected > 25
    assert differing <= 0.12 * expected
    both = [(found[i], truth[i]) for found, truth in pairs for i in set(found) & set(truth)]
    rendered, projected = np.array(both).transpose(1, 0, 2)
    distance = np.hypot(projected[:, 0], projected[:, 1])
    gap = np.hypot(*(rendered - projected)[:, :2].T) / distance
    assert np.median(gap) < 0.015
    assert np.quantile(gap, 0.9) < 0.03
    assert np.median(np.abs(rendered - projected)[:, 2]) < 0.06


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("axis", [-0.25, 0.25])
@pytest.mark.parametrize("middle", [-0.3, 0.3])
def test_a_rendered_gate_has_the_right_side_and_turn(axis, middle):
    side = np.array([-np.sin(axis), np.cos(axis)]) / 2
    markers = [(8 + i, 3.0 + s * side[0], middle + s * side[1], 0.2, axis + FACING) for i, s in enumerate((1, -1))]
    world = build(markers)
    poses = marker_poses(Detector().detect(OnboardCamera().capture(world.model, world.data)), LENS)
    seen = nearest_gate_and_marker(
        *(a[None] for a in (poses.ids, poses.x, poses.y, poses.heading, np.ones(len(poses.ids), bool)))
    )
    assert seen.gate_id[0] == 4
    assert seen.gate_x[0] == pytest.approx(3.0, rel=0.03)
    assert seen.gate_y[0] == pytest.approx(middle, abs=0.04)
    assert seen.gate_heading[0] == pytest.approx(axis, abs=0.06)


def test_the_smallest_side_is_a_quarter_of_the_shortest_outline_that_opencv_takes():
    rate = cv2.aruco.DetectorParameters().minMarkerPerimeterRate
    assert pytest.approx(rate / 4) == DETECTION_MODEL.min_side_share


def found_in_drawn_images(side: float, width: int) -> int:
    """Of 30 images of this width, px, with a marker of this side, px, those in which OpenCV finds it."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    plate = np.pad(cv2.aruco.generateImageMarker(dictionary, 2, 192), 32, constant_values=255)
    rng, detector, found = np.random.default_rng(4), Detector(), 0
    for x, y in rng.uniform(64, 96, (30, 2)):  # sixteenths of a pixel
        place = np.array([[side / 12, 0.0, x], [0.0, side / 12, y]])
        fine = cv2.warpAffine(plate, place, (512, 512), borderValue=110, flags=cv2.INTER_AREA)
        image = np.full((width * 3 // 4, width), 110, np.uint8)
        image[200:232, 300:332] = cv2.resize(fine, (32, 32), interpolation=cv2.INTER_AREA)
        found += detector.detect(image).ids.tolist() == [2]
    return found


def test_with_twice_the_pixels_markers_of_the_same_size_are_found_but_for_those_that_opencv_drops():
    def modelled(side: float, width: int) -> float:
        return float(DETECTION_MODEL.found(np.array([side]), np.array([2]), np.zeros(1), width)[0])

    assert found_in_drawn_images(9.0, 1280) == 0 < found_in_drawn_images(9.0, 640)
    assert modelled(9.0, 1280) == 0.0 < modelled(9.0, 640)
    assert found_in_drawn_images(12.0, 1280) == found_in_drawn_images(12.0, 640) > 0
    assert modelled(12.0, 1280) == modelled(12.0, 640) > 0.0


def test_a_lens_of_1280_pixels_sees_no_marker_that_opencv_would_drop():
    marker = (2, CAR.camera_x + 24.0, 0.0, CAR.camera_z, FACING)
    wide = LENS.scaled(1280, 960)
    side = wide.fx * wide.marker_size / 24.0
    assert 4.8 < side < 9.6
    assert not see([marker], lens=wide, chance=0.0).valid.any()
    assert see([marker], lens=wide, model=replace(EXACT, min_side_share=0.0), chance=0.0).valid.all()
