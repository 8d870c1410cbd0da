"""Pictures of the simulation, and the camera's image as an observation."""

import itertools
import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import tral_env.env
from tral_env.course.layout import Course, Gate, Segment
from tral_env.errors import ConfigError
from tral_env.simulation.views import VIEWS, Views

NO_OPENGL = """
import os
os.environ["MUJOCO_GL"] = "glfw"
os.environ.pop("DISPLAY", None)
import gymnasium as gym, tral_env
from tral_env.errors import RenderError
env = gym.make("TralCorridor-v0", scenario="straight", render_mode="rgb_array")
env.reset(seed=0)
try:
    env.render()
except RenderError as error:
    print("MUJOCO_GL=egl" in str(error), 'camera="projected"' in str(error))
"""

GATE_AHEAD = Course(name="gate", segments=(Segment(length=10, gates=(Gate(id=2, at=5, offset=0.3, yaw_deg=8),)),))


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("view", VIEWS)
def test_every_view_is_a_picture(view: str) -> None:
    env = gym.make("TralCorridor-v0", scenario="gates", render_mode="rgb_array", view=view, width=160, height=120)
    env.reset(seed=0)
    image = env.render()
    assert image.shape == (120, 160, 3)
    assert image.dtype == np.uint8
    assert image.std() > 10
    env.close()


@pytest.mark.usefixtures("opengl")
def test_the_chase_view_shows_the_red_car_in_the_lower_middle() -> None:
    env = tral_env.env.TralCorridorEnv(scenario="straight", randomization="none")
    env.reset(seed=0)
    red, green, blue = np.moveaxis(env.render_view("chase", 320, 240).astype(int), 2, 0)
    rows, columns = np.nonzero((red > 100) & (green < 60) & (blue < 60))
    assert len(rows) > 500
    assert rows.mean() > 120
    assert abs(columns.mean() - 160) < 15
    env.close()


@pytest.mark.usefixtures("opengl")
def test_pictures_follow_the_car_to_another_course() -> None:
    env = tral_env.env.TralCorridorEnv(scenario="corners")
    env.reset(seed=0)
    before = env.render_view("onboard", 160, 120)
    env.reset(seed=1)
    assert not np.array_equal(before, env.render_view("onboard", 160, 120))
    env.close()


@pytest.mark.usefixtures("opengl")
def test_a_rendered_gate_is_seen_where_the_projected_one_is() -> None:
    readings = []
    for camera in ("projected", "rendered"):
        env = gym.make("TralCorridor-v0", course=GATE_AHEAD, camera=camera, randomization="none")
        env.reset(seed=1)
        for _ in range(80):
            observation, *_ = env.step(np.array([0.0, 0.35], np.float32))
        readings.append(env.unwrapped.world.layout.unpack(observation))
        env.close()
    projected, rendered = readings
    assert rendered["gate_id"] == projected["gate_id"] >= 0
    assert rendered["gate_x"] == pytest.approx(float(projected["gate_x"]), rel=0.03)
    assert rendered["gate_y"] == pytest.approx(float(projected["gate_y"]), abs=0.03)
    assert rendered["gate_heading"] == pytest.approx(float(projected["gate_heading"]), abs=0.05)


@pytest.mark.usefixtures("opengl")
def test_gymnasiums_checker_finds_nothing_in_the_pixels() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make("TralCorridorPixels-v0", scenario="straight").unwrapped, skip_render_check=True)


@pytest.mark.usefixtures("opengl")
def test_an_image_stays_until_the_next_exposure() -> None:
    env = gym.make("TralCorridorPixels-v0", scenario="straight", image_size=(64, 48))
    observation, _ = env.reset(seed=0)
    assert observation["image"].shape == (48, 64, 3)
    images = [observation["image"]]
    for _ in range(80):
        observation, *_ = env.step(np.array([0.3, 0.5], np.float32))
        images.append(observation["image"])
    changes = sum(not np.array_equal(a, b) for a, b in itertools.pairwise(images))
    assert 10 <= changes <= 15
    env.close()


@pytest.mark.usefixtures("opengl")
def test_the_pixels_are_those_of_the_car_s_own_camera() -> None:
    env = gym.make("TralCorridorPixels-v0", course=GATE_AHEAD, randomization="none")
    images = {}
    for name, car in {
        "plain": {},
        "turned": {"camera_yaw_deg": 5.0},
        "degraded": {"image_degradation": 3.0},
        "again": {"image_degradation": 3.0},
    }.items():
        images[name] = env.reset(seed=1, options={"car": car})[0]["image"].astype(int)
    assert np.abs(images["plain"] - env.unwrapped.render_view("onboard", 160, 120)).mean() < 0.5
    # 5 degrees to the left move the picture right by 139 tan(5 deg) = 12 px.
    assert np.abs(images["turned"][:, 12:] - images["plain"][:, :-12]).mean() < 3
    assert np.abs(images["degraded"] - images["plain"]).mean() > 1
    assert np.array_equal(images["degraded"], images["again"])
    env.close()


def test_unknown_views_are_answered_with_the_nearest() -> None:
    env = tral_env.env.TralCorridorEnv(scenario="straight")
    env.reset(seed=0)
    with pytest.raises(ConfigError, match="did you mean 'onboard'"):
        Views().render(env.world.sim, "onbord", 0, 8, 8)


def test_without_opengl_the_error_names_the_remedy() -> None:
    out = subprocess.run([sys.executable, "-c", NO_OPENGL], capture_output=True, text=True, check=False)
    assert out.stdout.strip() == "True True", out.stderr
