"""What `image_faults` asks for reaches the images that the cars look at, and nothing else."""

from __future__ import annotations

import re
from collections.abc import Iterator

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from tral_env.config import CameraConfig, CarConfig
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, Gate, Segment
from tral_env.course.scene import Pool, build_model
from tral_env.errors import ConfigError
from tral_env.interface import CORE_LAYOUT
from tral_env.options import CorridorConfig
from tral_env.perception.aruco import Detector
from tral_env.perception.degrade import PATCH_GREYS, ImageCorruption
from tral_env.simulation.vision import RenderedVision, Webcam

GATE_AHEAD = Course(name="gate", segments=(Segment(length=6, gates=(Gate(id=2, at=4, offset=0.0, width=0.7),)),))
PATCH = ImageCorruption(exposure=0, blur_px=0, glare=0, noise=0, patch=0.3)
LEVEL_1 = {"car": {"image_degradation": 1.0, "camera_latency_s": 0.0}}
GATE_ID = CORE_LAYOUT.column("gate_id")
ROW, LEVELLED = np.zeros(1, np.int64), np.zeros(3)


@pytest.fixture(scope="module")
def before_the_gate(opengl: None) -> Iterator[tuple[Webcam, RenderedVision, np.ndarray]]:
    """A webcam and an eye with the same patch, and the state of a car 2 m before the gate."""
    plan = build_plan(GATE_AHEAD)
    pool, lens = Pool.of(plan), CameraConfig()
    webcam, vision = Webcam(1, pool, lens, PATCH), RenderedVision(1, pool, lens, CarConfig(), PATCH)
    qpos = build_model(pool).qpos0.copy()
    qpos[0] = 2.0
    webcam.place(0, plan, 0.0, 0)
    yield webcam, vision, qpos
    webcam.close()
    vision.close()


def pixels(seed: int = 3, **kwargs: object) -> np.ndarray:
    given = {"course": GATE_AHEAD, "camera": "rendered", "randomization": "none", **kwargs}
    env = gym.make("TralCorridorPixels-v0", **given)
    try:
        return np.array(env.reset(seed=seed, options=LEVEL_1)[0]["image"], int)
    finally:
        env.close()


def box(image: np.ndarray, clean: np.ndarray) -> np.ndarray:
    """(2, 2) least and greatest x, y of what a patch covers."""
    y, x = np.nonzero(np.any(image != clean, axis=2))
    return np.array([[x.min(), y.min()], [x.max(), y.max()]])


def test_a_gate_is_seen_unless_the_patch_lies_on_one_of_its_markers(
    before_the_gate: tuple[Webcam, RenderedVision, np.ndarray],
) -> None:
    webcam, vision, qpos = before_the_gate
    plan = build_plan(GATE_AHEAD)
    webcam.place(0, plan, 0.0, 0)
    clean = webcam.image(0, qpos, LEVELLED)
    corners = Detector().detect(clean).corners  # (2, 4, 2)
    seen = {"on": [], "beside": []}
    for seed in range(40):
        webcam.place(0, plan, 1.0, seed)
        vision.place(0, plan, 1.0, seed)
        low, high = box(webcam.image(0, qpos, LEVELLED), clean)
        sighting = vision.see(ROW, np.zeros((1, 3)), qpos[None], LEVELLED[None])
        middles, margin = corners.mean(axis=1), 25.0
        if np.any(np.all((low < middles) & (middles < high), axis=1)):
            seen["on"].append(sighting.gate_id[0])
        elif np.all(np.any((corners.max(axis=1) + margin < low) | (high < corners.min(axis=1) - margin), axis=1)):
            seen["beside"].append(sighting.gate_id[0])
    assert len(seen["on"]) >= 5
    assert set(seen["on"]) == {-1}
    assert len(seen["beside"]) >= 15
    assert set(seen["beside"]) == {2}


@pytest.mark.usefixtures("opengl")
def test_the_readings_come_from_the_images_with_the_faults() -> None:
    faults = ImageCorruption(patch=0.5)
    env = gym.make("TralCorridor-v0", course=GATE_AHEAD, camera="rendered", randomization="none", image_faults=faults)
    webcam, told = None, set()
    try:
        for seed in range(16):
            env.reset(seed=seed, options=LEVEL_1)
            sim = env.unwrapped.world.sim
            webcam = webcam or Webcam(1, sim.pool, sim.lens, faults)
            webcam.place(0, sim.plan(0), 1.0, int(sim.cameras.image_seeds[0]))
            found = Detector().detect(webcam.image(0, sim.physics.qpos[0], LEVELLED)).ids
            for _ in range(4):  # until the image of the reset is told, and before the next one is taken
                observation, *_ = env.step(np.zeros(2, np.float32))
            seen = float(observation[GATE_ID])
            assert seen == (2 if len(found) == 2 else -1)
            told.add(seen)
    finally:
        env.close()
        if webcam is not None:
            webcam.close()
    assert told == {2, -1}


@pytest.mark.usefixtures("opengl")
def test_the_pixels_show_the_faults_that_are_asked_for_and_no_others() -> None:
    clear = ImageCorruption(exposure=0, blur_px=0, glare=0, noise=0)
    clean, patched = pixels(image_faults=clear), pixels(image_faults=PATCH)
    low, high = box(patched, clean)
    assert np.all(high - low + 1 <= 0.3 * 120)
    covered = patched[np.any(patched != clean, axis=2)]
    assert len(np.unique(covered)) == 1
    assert covered[0, 0] in PATCH_GREYS


@pytest.mark.usefixtures("opengl")
def test_the_pixels_show_the_faults_wherever_the_readings_come_from() -> None:
    image = pixels(camera="projected", image_faults=PATCH)
    assert np.array_equal(image, pixels(camera="rendered", image_faults=PATCH))
    assert not np.array_equal(image, pixels(camera="projected"))


@pytest.mark.usefixtures("opengl")
def test_the_same_seed_gives_the_same_image() -> None:
    faults = ImageCorruption(streak_px=2.0, patch=0.2)
    image = pixels(image_faults=faults)
    assert np.array_equal(image, pixels(image_faults=faults))
    assert not np.array_equal(image, pixels(4, image_faults=faults))


@pytest.mark.usefixtures("opengl")
def test_without_it_an_image_is_as_it_was_with_the_default_faults() -> None:
    assert np.array_equal(pixels(), pixels(image_faults=ImageCorruption()))


@pytest.mark.usefixtures("opengl")
def test_a_row_among_others_looks_through_the_same_faults_as_alone() -> None:
    given = {"course": GATE_AHEAD, "camera": "rendered", "image_faults": PATCH}
    single = gym.make("TralCorridor-v0", **given)
    rows = gym.make_vec("TralCorridor-v0", num_envs=2, **given)
    alone = [single.reset(seed=6)[0]]
    among = [rows.reset(seed=5)[0][1]]
    command = np.array([0.0, 0.4], np.float32)
    for _ in range(40):
        alone.append(single.step(command)[0])
        among.append(rows.step(np.tile(command, (2, 1)))[0][1])
    assert np.array_equal(alone, among)
    single.close()
    rows.close()


@pytest.mark.parametrize(("name", "camera"), [("TralCorridor-v0", "rendered"), ("TralCorridorPixels-v0", "projected")])
def test_the_spec_with_faults_survives_json(name: str, camera: str) -> None:
    env = gym.make(name, scenario="gates", camera=camera, image_faults=PATCH)
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.world.config.image_faults == PATCH


@pytest.mark.parametrize("make", [gym.make, gym.make_vec])
def test_the_projected_camera_refuses_faults_and_names_the_remedy(make: object) -> None:
    with pytest.raises(
        ConfigError, match=r"image_faults.*patch=0\.2.*expected camera='rendered', or TralCorridorPixels-v0"
    ):
        make("TralCorridor-v0", image_faults={"patch": 0.2})


def test_the_default_faults_are_those_that_the_projected_camera_has_too() -> None:
    assert CorridorConfig.of({"image_faults": ImageCorruption()}) == CorridorConfig()


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"pach": 0.1}, "ImageCorruption has no 'pach': did you mean 'patch'"),
        ({"patch": 2.0}, "ImageCorruption.patch = 2.0: expected a number from 0 to 1"),
        (0.1, "got 0.1: expected a ImageCorruption, or a mapping of its values"),
    ],
)
def test_faults_that_cannot_be_are_named(given: object, told: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(told)):
        CorridorConfig.of({"camera": "rendered", "image_faults": given})
