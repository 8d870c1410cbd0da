"""Pictures of the simulation, and the camera's image as an observation."""

import itertools
import subprocess
import sys
import types
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers.vector import RecordVideo

import tral_env.env
from tral_env.course.layout import Course, Gate, Segment
from tral_env.env import TralCorridorEnv, TralCorridorPixelsEnv
from tral_env.errors import ConfigError
from tral_env.perception.aruco import Detector
from tral_env.perception.degrade import ImageCorruption
from tral_env.simulation.views import VIEWS
from tral_env.vector_env import TralCorridorVectorEnv

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


@pytest.mark.parametrize("size", [{"width": 0}, {"height": -3}, {"width": 4.5}, {"height": True}])
def test_a_picture_of_no_size_is_refused(size: dict) -> None:
    env = TralCorridorEnv(scenario="straight")
    env.reset(seed=0)
    with pytest.raises(ConfigError, match="expected a whole number, 1 or more"):
        env.render_view("chase", **size)


@pytest.mark.parametrize("env", [TralCorridorEnv, TralCorridorPixelsEnv])
@pytest.mark.parametrize("view", VIEWS)
def test_there_is_no_picture_before_a_reset(env: type, view: str) -> None:
    with pytest.raises(ConfigError, match="no course before the first reset"):
        env(scenario="straight").render_view(view)


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
def test_an_image_arrives_with_what_the_readings_tell_of_it() -> None:
    env = gym.make("TralCorridorPixels-v0", course=GATE_AHEAD, randomization="none", image_size=(64, 48))
    observation, _ = env.reset(seed=1, options={"car": {"camera_latency_s": 0.1}})
    gate = env.unwrapped.world.layout.column("gate_id")
    seen = []
    for _ in range(10):
        seen.append((observation["image"].any(), observation["readings"][gate] >= 0))
        observation, *_ = env.step(np.zeros(2, np.float32))
    assert seen == [(False, False)] * 8 + [(True, True)] * 2
    assert not env.reset(seed=1)[0]["image"].any()
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
        images[name] = env.reset(seed=1, options={"car": {"camera_latency_s": 0.0, **car}})[0]["image"].astype(int)
    assert np.array_equal(images["again"], env.unwrapped.render_view("onboard", 160, 120))
    # 5 degrees to the left move the picture right by 139 tan(5 deg) = 12 px.
    assert np.abs(images["turned"][:, 12:] - images["plain"][:, :-12]).mean() < 3
    assert np.abs(images["degraded"] - images["plain"]).mean() > 1
    assert np.array_equal(images["degraded"], images["again"])
    env.close()


ODD = {"camera_yaw_deg": 6.0, "camera_roll_deg": 5.0, "image_degradation": 3.0}
FAULTS = ImageCorruption(streak_px=2.0, patch=0.1)


@pytest.mark.usefixtures("opengl")
def test_the_onboard_view_is_the_image_that_the_detector_searches(monkeypatch: pytest.MonkeyPatch) -> None:
    searched, detect = [], Detector.detect

    def spy(self: Detector, image: np.ndarray) -> object:
        searched.append(image.copy())
        return detect(self, image)

    monkeypatch.setattr(Detector, "detect", spy)
    options = {"course": GATE_AHEAD, "camera": "rendered", "lens": "wide", "image_faults": FAULTS}
    watched, alone = (gym.make("TralCorridor-v0", **options).unwrapped for _ in range(2))
    for env in (alone, watched):
        env.reset(seed=1, options={"car": ODD})
    for _ in range(20):
        command = np.array([0.2, 0.4], np.float32)
        expected, *_ = alone.step(command)
        observation, *_ = watched.step(command)
        seen = searched[-1]
        assert np.array_equal(watched.render_view("onboard", 640, 480), seen)
        assert np.array_equal(observation, expected)  # to look changes nothing
    assert len(searched) > 4
    assert np.array_equal(watched.render_view("onboard", 1000, 480)[:, 180:820], seen)
    assert not watched.render_view("onboard", 1000, 480)[:, :180].any()
    for env in (alone, watched):
        env.close()


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("lens", ["default", "wide"])
def test_a_projected_camera_shows_what_it_would_take(lens: str) -> None:
    still = {"camera_latency_s": 0.0, "camera_yaw_deg": 6.0, "camera_roll_deg": 5.0, "camera_pitch_deg": -3.0}
    taken = gym.make("TralCorridorPixels-v0", course=GATE_AHEAD, lens=lens, randomization="none", image_size=(640, 480))
    image = taken.reset(seed=1, options={"car": still})[0]["image"]
    env = gym.make("TralCorridor-v0", course=GATE_AHEAD, lens=lens, randomization="none", image_faults=None).unwrapped
    env.reset(seed=1, options={"car": still})
    assert np.array_equal(env.render_view("onboard", 640, 480), image)
    env.reset(seed=1, options={"car": still | {"image_degradation": 3.0}})
    spoilt = env.render_view("onboard", 640, 480)
    assert np.abs(spoilt.astype(int) - image).mean() > 3
    assert np.array_equal(env.render_view("onboard", 640, 480), spoilt)
    taken.close()
    env.close()


@pytest.mark.usefixtures("opengl")
def test_a_vector_environment_gives_a_picture_of_each_row() -> None:
    options = {"scenario": "gates", "render_mode": "rgb_array", "width": 160, "height": 120}
    envs = gym.make_vec("TralCorridor-v0", num_envs=2, **options)
    envs.reset(seed=3)
    pictures = envs.render()
    for row, picture in enumerate(pictures):
        env = gym.make("TralCorridor-v0", **options)
        env.reset(seed=3 + row)
        assert np.array_equal(env.render(), picture)
        env.close()
    envs.close()
    assert gym.make_vec("TralCorridor-v0", num_envs=2).render() is None


def test_a_vector_environment_refuses_other_pictures() -> None:
    with pytest.raises(ConfigError, match="unknown render_mode 'human'"):
        TralCorridorVectorEnv(2, render_mode="human")
    with pytest.raises(ConfigError, match="did you mean 'onboard'"):
        TralCorridorVectorEnv(2, view="onbord")
    with pytest.raises(ConfigError, match="width = 0: expected a whole number, 1 or more"):
        TralCorridorVectorEnv(2, width=0)


@pytest.fixture
def clips(monkeypatch: pytest.MonkeyPatch) -> list[list[np.ndarray]]:
    """The videos that a recorder hands to moviepy, which is not needed for the frames."""
    written: list[list[np.ndarray]] = []

    class Clip:
        def __init__(self, frames: list[np.ndarray], fps: float) -> None:
            assert fps == 80
            written.append(frames)

        def write_videofile(self, *_: object, **__: object) -> None:
            pass

    names = ("moviepy", "moviepy.video", "moviepy.video.io", "moviepy.video.io.ImageSequenceClip")
    for name in names:
        module = types.ModuleType(name)
        module.ImageSequenceClip = Clip  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, name, module)
    return written


@pytest.mark.usefixtures("opengl")
def test_gymnasium_records_a_vector_environment(tmp_path: Path, clips: list[list[np.ndarray]]) -> None:
    envs = gym.make_vec("TralCorridor-v0", num_envs=2, scenario="gates", render_mode="rgb_array", width=64, height=48)
    envs = RecordVideo(envs, str(tmp_path / "videos"), episode_trigger=lambda episode: True, video_length=5)
    envs.reset(seed=1)
    for _ in range(6):
        envs.step(np.tile([0.1, 0.4], (2, 1)))
    envs.close()
    assert [len(clip) for clip in clips] == [6]
    assert clips[0][0].size == 2 * 64 * 48 * 3
    assert not np.array_equal(clips[0][0], clips[0][-1])


@pytest.mark.usefixtures("opengl")
def test_stable_baselines_records_up_to_sixteen_cars(tmp_path: Path, clips: list[list[np.ndarray]]) -> None:
    pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import VecVideoRecorder

    from tral_env.sb3 import make_vec_env

    envs = make_vec_env(17, scenario="straight", seed=1, render_mode="rgb_array", width=16, height=12, courses=2)
    envs = VecVideoRecorder(envs, str(tmp_path), record_video_trigger=lambda step: step == 0, video_length=3)
    envs.reset()
    for _ in range(4):
        envs.step(np.tile([0.1, 0.4], (17, 1)))
    envs.close()
    assert [len(clip) for clip in clips] == [4]
    assert clips[0][0].shape == (4 * 12, 4 * 16, 3)


FORKED = """
import gymnasium as gym, numpy as np
from tral_env.errors import RenderError

def make():
    return gym.make("tral_env:TralCorridor-v0", course="short", camera="rendered")

env = make()
env.reset(seed=0)
envs = gym.vector.AsyncVectorEnv([make], context="fork")
try:
    envs.reset(seed=0)
except RenderError as error:
    print('context="spawn"' in str(error))
envs.close(terminate=True)
env.reset(seed=1)
env.close()
print("the parent goes on")
"""


@pytest.mark.usefixtures("opengl")
def test_opengl_in_a_forked_process_is_refused_instead_of_hanging() -> None:
    command = [sys.executable, "-W", "ignore", "-c", FORKED]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.stdout.split("\n") == ["True", "the parent goes on", ""], done.stderr


def test_unknown_views_are_answered_with_the_nearest() -> None:
    env = tral_env.env.TralCorridorEnv(scenario="straight")
    env.reset(seed=0)
    with pytest.raises(ConfigError, match="did you mean 'onboard'"):
        env.render_view("onbord", 8, 8)


def test_without_opengl_the_error_names_the_remedy() -> None:
    out = subprocess.run([sys.executable, "-c", NO_OPENGL], capture_output=True, text=True, check=False)
    assert out.stdout.strip() == "True True", out.stderr


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("camera", ["projected", "rendered"])
def test_a_still_shows_the_moment_at_which_it_was_taken_in_any_thread(camera: str) -> None:
    env = gym.make("TralCorridor-v0", course=GATE_AHEAD, camera=camera).unwrapped
    env.reset(seed=1)
    stills, size = env.stills(), (160, 120)
    for _ in range(9):
        env.step(np.array([0.3, 0.5], np.float32))
    shown = {view: env.render_view(view, *size) for view in ("chase", "onboard")}
    taken = {view: stills.take(view, *size) for view in shown}
    for _ in range(9):
        env.step(np.array([0.3, 0.5], np.float32))
    with ThreadPoolExecutor(1) as thread:
        later = {view: thread.submit(take).result() for view, take in taken.items()}
        thread.submit(stills.close).result()
    for view, image in shown.items():
        assert np.array_equal(later[view], image)
        assert not np.array_equal(later[view], env.render_view(view, *size))
    env.close()
