import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from marker_world import build

from tral_env.config import WIDE_LENS, CameraConfig, CarConfig
from tral_env.course.generate import generate_plan
from tral_env.course.scene import Pool
from tral_env.errors import ConfigError, RenderError
from tral_env.perception.camera import OnboardCamera, SceneRenderer
from tral_env.perception.frustum import Frustum
from tral_env.perception.lens import mounting_turn, project_points
from tral_env.simulation.render_scene import RenderScene

OFF_CENTRE = CameraConfig(fx=500.0, fy=520.0, cx=300.0, cy=250.0)
PATCH = 0.05


def white_patch(y, z):
    """One thin white square 1.8 m before the camera, all else black, lit evenly."""
    world = build([], [(2.0, y, CarConfig().camera_z + z, 0.0, 1e-4, PATCH, PATCH)])
    light = world.model.vis.headlight
    light.ambient[:], light.diffuse[:], light.specular[:] = 1.0, 0.0, 0.0
    world.model.geom_rgba[:] = 0.0, 0.0, 0.0, 1.0
    world.model.geom_rgba[world.model.geom("box/0").id] = 1.0
    return world


POOL = Pool.for_scenario("office")


def drawn_plan():
    return generate_plan("office", np.random.default_rng(7))[1]


def car_at(scene, x, y, yaw):
    qpos = scene.model.qpos0.copy()
    qpos[:2], qpos[3:7] = (x, y), (np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2))
    return qpos


def expected_middle(y, z, lens, mounting):
    grid = np.linspace(-PATCH, PATCH, 51)
    right, up = np.meshgrid(y + grid, z + grid)
    rays = np.stack([np.full_like(up, 2.0 - 1e-4 - CarConfig().camera_x), right, up], axis=-1)
    return project_points(rays @ mounting_turn(np.array([mounting]))[0], lens).reshape(-1, 2).mean(axis=0)


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("lens", [CameraConfig(), WIDE_LENS, OFF_CENTRE], ids=["default", "wide", "off centre"])
@pytest.mark.parametrize("mounting", [(0.03, 0.0, 0.0), (0.02, -0.03, 0.04)], ids=["rolled", "turned"])
@pytest.mark.parametrize(("y", "z"), [(0.6, 0.3), (-0.6, -0.1), (0.03, 0.02)])
def test_a_rendered_point_lies_where_the_lens_model_says_within_a_tenth_of_a_pixel(lens, mounting, y, z):
    world = white_patch(y, z)
    with OnboardCamera(renderer=SceneRenderer(offsamples=4)).renderer as renderer:
        image = OnboardCamera(lens, renderer=renderer).capture(world.model, world.data, mounting)[..., 0].astype(float)
    v, u = np.mgrid[: lens.height, : lens.width]
    middle = np.array([(image * u).sum(), (image * v).sum()]) / image.sum()
    assert middle == pytest.approx(expected_middle(y, z, lens, mounting), abs=0.1)


@pytest.mark.usefixtures("opengl")
def test_an_image_has_the_size_of_the_lens():
    camera = OnboardCamera(WIDE_LENS)
    world = build([])
    image = camera.capture(world.model, world.data)
    assert image.shape == (480, 640, 3)
    assert image.dtype == np.uint8


@pytest.mark.usefixtures("opengl")
def test_any_camera_is_rendered_at_any_size_one_after_the_other():
    camera, world = OnboardCamera(), white_patch(0.0, 0.0)
    for width, height in ((64, 48), (1280, 720), (320, 240)):
        image = camera.renderer.render(world.model, world.data, "car/front", width, height)
        assert image.shape == (height, width, 3)
        assert image[height // 2, width // 2, 0] == 255


@pytest.mark.usefixtures("opengl")
def test_several_renderers_do_not_disturb_each_other():
    world = white_patch(0.0, 0.0)
    one, other = OnboardCamera(), OnboardCamera()
    before = one.capture(world.model, world.data)
    other.capture(world.model, world.data)
    del other
    assert (one.capture(world.model, world.data) == before).all()


@pytest.mark.usefixtures("opengl")
def test_one_renderer_shows_courses_with_other_textures():
    camera = OnboardCamera()
    worlds = [build([(marker, 1.2, 0.0, 0.2, np.pi)]) for marker in (0, 1)]
    first, second, again = (camera.capture(world.model, world.data) for world in (*worlds, worlds[0]))
    assert (first == again).all()
    assert (first != second).any()


@pytest.mark.usefixtures("opengl")
def test_a_picture_does_not_depend_on_the_one_before():
    camera, scene, plan = OnboardCamera(), RenderScene(POOL), drawn_plan()
    there, elsewhere = car_at(scene, 0.0, 0.0, 0.0), car_at(scene, 7.0, 1.0, 2.0)
    first = camera.capture(*scene.show(plan, there))
    camera.capture(*scene.show(plan, elsewhere))
    assert (camera.capture(*scene.show(plan, there)) == first).all()


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("view", ["car/chase", "car/front", "car/top"])
@pytest.mark.parametrize("yaw", [-2.0, 0.3, 1.6])
def test_what_is_left_out_of_a_scene_is_not_in_the_picture(monkeypatch, view, yaw):
    scene, plan = RenderScene(POOL), drawn_plan()
    lens = OFF_CENTRE if view == "car/front" else None
    pictures = []
    for whole in (False, True):
        if whole:
            monkeypatch.setattr(Frustum, "outside", lambda self, centre, radius: np.zeros(len(radius), bool))
        with SceneRenderer(offsamples=0) as renderer:
            model, data = scene.show(plan, car_at(scene, 3.0, 0.2, yaw))
            pictures.append(renderer.render(model, data, view, 320, 240, intrinsics=lens, mounting=(0.03, -0.1, 0.2)))
    assert (pictures[0] == pictures[1]).all()


@pytest.mark.usefixtures("opengl")
def test_a_model_is_as_it_was_after_a_picture():
    scene = RenderScene(POOL)
    before = scene.model.geom_group.copy()
    OnboardCamera().capture(*scene.show(drawn_plan(), car_at(scene, 0.0, 0.0, 0.0)))
    assert (scene.model.geom_group == before).all()


@pytest.mark.usefixtures("opengl")
def test_a_closed_renderer_opens_again():
    camera, world = OnboardCamera(), white_patch(0.0, 0.0)
    before = camera.capture(world.model, world.data)
    camera.close()
    assert (camera.capture(world.model, world.data) == before).all()


@pytest.mark.usefixtures("opengl")
def test_an_unknown_camera_is_named_with_the_nearest_one():
    camera, world = OnboardCamera(), build([])
    with pytest.raises(ConfigError, match=r"no camera 'car/fornt'.*did you mean 'car/front'"):
        camera.renderer.render(world.model, world.data, "car/fornt", 64, 48)


def test_without_opengl_the_error_names_the_remedy(monkeypatch):
    for module in ("mujoco.egl", "mujoco.rendering.classic.gl_context"):
        monkeypatch.setitem(sys.modules, module, SimpleNamespace(GLContext=_refuse))
    world = build([])
    with pytest.raises(RenderError, match=r"no display here.*MUJOCO_GL=egl.*camera=\"projected\""):
        SceneRenderer().render(world.model, world.data, "car/front", 64, 48)


def _refuse(width, height):
    raise ImportError("no display here")


def test_the_projected_camera_needs_neither_mujoco_nor_opencv_nor_opengl():
    code = (
        "import sys, tral_env.perception.projected, tral_env.perception.gate\n"
        "sys.exit(','.join({'mujoco', 'cv2', 'OpenGL', 'glfw'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == ""
