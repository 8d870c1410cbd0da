"""What a camera sees of its course: projected without noise where there is none, rendered as OpenCV finds it."""

from collections.abc import Iterator

import numpy as np
import pytest
from one_car import CORRIDOR, GATE_AHEAD

from tral_env.config import WIDE_LENS, CameraConfig, CarConfig
from tral_env.course.geometry import build_plan
from tral_env.course.plan import Plan
from tral_env.course.scene import Pool
from tral_env.noise import NoiseTape
from tral_env.simulation.render_scene import RenderScene
from tral_env.simulation.vision import ProjectedVision, RenderedVision, Vision, Webcam

GATE, EMPTY = build_plan(GATE_AHEAD), build_plan(CORRIDOR)
LENS, CAR, POOL = CameraConfig(), CarConfig(), Pool.of(build_plan(GATE_AHEAD)).union(Pool.of(build_plan(CORRIDOR)))
LEVEL = np.zeros((1, 3))
ROW = np.array([0])


def state(plan: Plan, x: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    """Pose and full state of a car in the middle of a corridor, (1, 3) and (1, nq)."""
    qpos = RenderScene(POOL).data.qpos.copy()
    pose = np.array([[x, plan.start[1], plan.start[2]]])
    qpos[:2] = pose[0, :2]
    return pose, qpos[None]


def projected(n: int, seed: int = 0) -> tuple[ProjectedVision, NoiseTape]:
    noise = NoiseTape(n)
    for row in range(n):
        noise.reset(row, np.random.default_rng(seed + row))
    return ProjectedVision(n, noise, LENS, CAR), noise


@pytest.fixture
def rendered(opengl: None) -> Iterator[RenderedVision]:
    vision = RenderedVision(1, POOL, LENS, CAR)
    yield vision
    vision.close()


def check_that_the_gate_is_seen(vision: Vision) -> None:
    vision.place(0, GATE, 0.0, 7)
    pose, qpos = state(GATE)
    seen = vision.see(ROW, pose, qpos, LEVEL)
    assert seen.gate_id.tolist() == [2]
    assert seen.gate_x[0] == pytest.approx(GATE.gate_pose[0, 0] - pose[0, 0], rel=0.05)
    vision.place(0, EMPTY, 0.0, 7)
    assert vision.see(ROW, *state(EMPTY), LEVEL).gate_id.tolist() == [-1]


def test_the_projected_camera_sees_the_gate_of_its_course() -> None:
    check_that_the_gate_is_seen(projected(1)[0])


def test_the_rendered_camera_sees_the_gate_of_its_course(rendered: RenderedVision) -> None:
    check_that_the_gate_is_seen(rendered)


def test_a_row_without_markers_draws_no_noise() -> None:
    vision, noise = projected(2)
    untouched = projected(2)[1]
    vision.place(0, EMPTY, 0.0, 7)
    vision.place(1, GATE, 0.0, 7)
    (pose, qpos), rows = state(GATE), np.array([0, 1])
    vision.see(rows, np.repeat(pose, 2, axis=0), np.repeat(qpos, 2, axis=0), np.zeros((2, 3)))
    now, fresh = noise.uniform(rows, 1), untouched.uniform(rows, 1)
    assert now[0] == fresh[0]
    assert now[1] != fresh[1]


def test_the_projected_camera_takes_no_images() -> None:
    vision, _ = projected(1)
    vision.place(0, GATE, 1.0, 7)
    vision.see(ROW, *state(GATE), LEVEL)
    assert vision.last_image(0) is None


def test_the_last_image_is_the_same_to_the_bit_until_the_next(opengl: None) -> None:
    webcam = Webcam(1, POOL, LENS.scaled(160, 120))
    webcam.place(0, GATE, 1.0, 7)
    assert webcam.last_image(0) is None
    _, qpos = state(GATE)
    taken = webcam.image(0, qpos[0], LEVEL[0])
    assert np.array_equal(webcam.last_image(0), taken)
    assert not np.array_equal(webcam.image(0, qpos[0], LEVEL[0]), taken)  # new noise
    webcam.place(0, GATE, 1.0, 7)
    assert webcam.last_image(0) is None
    assert np.array_equal(webcam.image(0, qpos[0], LEVEL[0]), taken)  # the noise is that of the seed
    webcam.close()


@pytest.mark.parametrize("lens", [LENS.scaled(320, 240), WIDE_LENS.scaled(320, 240)], ids=["default", "wide"])
def test_an_image_that_cannot_show_a_marker_is_not_searched_and_tells_the_same(
    opengl: None, monkeypatch: pytest.MonkeyPatch, lens: CameraConfig
) -> None:
    rng = np.random.default_rng(3)
    _, start = state(GATE)
    mounting = np.array([[0.02, -0.05, 0.06]])
    places = np.repeat(start, 40, axis=0)
    places[:, 0] = rng.uniform(0.5, 5.0, 40)
    yaw = rng.uniform(-np.pi, np.pi, 40)
    places[:, 3], places[:, 6] = np.cos(yaw / 2), np.sin(yaw / 2)

    def drive() -> tuple[list[list[float]], np.ndarray, int]:
        searched = 0
        vision = RenderedVision(1, POOL, lens, CAR)
        vision.place(0, GATE, 1.0, 7)
        look = vision._detector.detect

        def detect(image: np.ndarray) -> object:
            nonlocal searched
            searched += 1
            return look(image)

        monkeypatch.setattr(vision._detector, "detect", detect)
        seen = [vision.see(ROW, np.zeros((1, 3)), qpos[None], mounting) for qpos in places]
        image = vision.last_image(0)
        vision.close()
        assert image is not None
        told = [[float(getattr(one, name)[0]) for name in one.__annotations__] for one in seen]
        return told, image, searched

    some, last, searched = drive()
    monkeypatch.setattr(Webcam, "may_show_a_marker", lambda self, row: True)
    every, same, searched_all = drive()
    assert some == every
    assert np.array_equal(last, same)
    assert 0 < searched < searched_all == 40
    assert any(told[4] >= 0 for told in every)
