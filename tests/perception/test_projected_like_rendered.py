"""Both simulated cameras find as many markers, and are as wrong about them: clean, mildly and strongly degraded."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from marker_world import plan_of

from tral_env.config import CameraConfig, CarConfig
from tral_env.course.plan import BOX_KINDS, Plan
from tral_env.course.scene import Pool
from tral_env.perception.aruco import Detector, marker_poses
from tral_env.perception.camera import OnboardCamera
from tral_env.perception.degrade import degrade
from tral_env.perception.projected import NOISE_PLACES, NORMALS, UNIFORMS, Scenery, project
from tral_env.se2 import wrap
from tral_env.simulation.render_scene import RenderScene

LENS, CAR = CameraConfig(), CarConfig()
LEVELS = {"off": 0.0, "mild": 1.0, "strong": 3.0}
DISTANCES = (1.5, 3.0, 4.0, 5.0)
VIEWS = 60
"""At each distance."""
DRAWS = 20
"""Of the projected camera's noise for each view."""
IDS = np.arange(10)
"""Of five gates: when blurred, some codes are lost before others."""
WALLS = [
    (6.0, 5.0, 1.2, 0.0, 8.0, 0.05, 1.2),
    (6.0, -5.0, 1.2, 0.0, 8.0, 0.05, 1.2),
    (12.0, 0.0, 1.2, 0.0, 0.05, 5, 1.2),
]

RATE = 0.1
"""Largest difference of the shares that are found: twice the spread that chance leaves after so many views."""
RATIO = {"position": 1.6, "bearing": 1.6, "heading": 1.8}
"""Largest ratio between quantiles of the errors; whether a far marker's heading is mirrored is near a toss."""
POSITION, BEARING_DEG, HEADING_DEG = 0.001, 0.005, 0.3
"""Differences of quantiles that do not matter: of the position as a share of the distance, and of angles."""


def views() -> dict[str, np.ndarray]:
    """Where markers stand before the car, each (n,); all wholly in the image."""
    rng = np.random.default_rng(11)
    nominal = np.repeat(DISTANCES, VIEWS)
    n = len(nominal)
    distance, bearing = nominal * rng.uniform(0.95, 1.05, n), rng.uniform(-0.4, 0.4, n)
    return {
        "nominal": nominal,
        "distance": distance,
        "bearing": bearing,
        "x": CAR.camera_x + distance * np.cos(bearing),
        "y": distance * np.sin(bearing),
        "id": np.resize(IDS, n),
        "z": rng.uniform(0.15, 0.3, n),
        "heading": bearing + rng.uniform(-0.8, 0.8, n),
    }


def plans(seen: dict[str, np.ndarray]) -> list[Plan]:
    """A hall with one marker for each view."""
    markers = zip(seen["id"], seen["x"], seen["y"], seen["z"], seen["heading"] + np.pi, strict=True)
    # What is behind a marker matters: the colour of walls, not of boxes.
    kind = np.full(len(WALLS), BOX_KINDS.index("wall"))
    return [replace(plan_of([marker], WALLS), box_kind=kind) for marker in markers]


def errors(truth: dict[str, np.ndarray], seen: np.ndarray) -> dict[str, np.ndarray]:
    """Of x, y, heading (n, 3): of the position as a share of the distance, of bearing and heading in degrees."""
    off_x, off_y = seen[:, 0] - truth["x"], seen[:, 1] - truth["y"]
    across = np.cos(truth["bearing"]) * off_y - np.sin(truth["bearing"]) * off_x
    return {
        "position": np.hypot(off_x, off_y) / truth["distance"],
        "bearing": np.degrees(np.abs(across / truth["distance"])),
        "heading": np.degrees(np.abs(wrap(seen[:, 2] - truth["heading"]))),
    }


@cache
def rendered() -> dict[str, dict[str, np.ndarray]]:
    """Errors by level, (n,) each, NaN where nothing is found."""
    camera, detector, rng = OnboardCamera(), Detector(), np.random.default_rng(5)
    stage, truth = RenderScene(Pool(len(WALLS), 1)), views()
    seen = {name: np.full((len(truth["x"]), 3), np.nan) for name in LEVELS}
    rest = stage.data.qpos.copy()
    for row, plan in enumerate(plans(truth)):
        image = camera.capture(*stage.show(plan, rest))
        for name, level in LEVELS.items():
            poses = marker_poses(detector.detect(degrade(image, level, rng)), LENS)
            if poses.ids.tolist() == [truth["id"][row]]:
                seen[name][row] = poses.x[0], poses.y[0], poses.heading[0]
    camera.close()
    return {name: errors(truth, found) for name, found in seen.items()}


def projected(level: float) -> dict[str, np.ndarray]:
    """Errors, (DRAWS * n,) each."""
    truth = {name: np.tile(values, DRAWS) for name, values in views().items()}
    n, rng = len(truth["x"]), np.random.default_rng(6)
    scenery = Scenery(n)
    for row, plan in enumerate(plans(truth)):
        scenery.place(row, plan)
    seen = project(
        scenery,
        np.arange(n),
        np.zeros((n, 3)),
        LENS,
        CAR,
        mounting=np.zeros((n, 3)),
        normal=rng.standard_normal((n, NOISE_PLACES, NORMALS)),
        uniform=rng.random((n, NOISE_PLACES, UNIFORMS)),
        degradation=np.full(n, level),
    )
    found = np.column_stack([seen.x[:, 0], seen.y[:, 0], seen.heading[:, 0]])
    return errors(truth, np.where(seen.valid, found, np.nan))


@pytest.fixture(scope="module", params=LEVELS)
def both(request):
    return rendered()[request.param], projected(LEVELS[request.param])


@pytest.mark.parametrize("distance", DISTANCES)
def test_both_cameras_find_the_same_share(both, distance):
    nominal = views()["nominal"]
    real = ~np.isnan(both[0]["position"][nominal == distance])
    imitated = ~np.isnan(both[1]["position"][np.tile(nominal, DRAWS) == distance])
    assert abs(real.mean() - imitated.mean()) <= RATE


@pytest.mark.parametrize(
    ("what", "shares", "small"),
    [("position", (0.5, 0.9), POSITION), ("bearing", (0.5, 0.8), BEARING_DEG), ("heading", (0.5, 0.75), HEADING_DEG)],
)
@pytest.mark.parametrize("distance", DISTANCES[:3])
def test_both_cameras_are_as_wrong(both, distance, what, shares, small):
    nominal = views()["nominal"]
    real = np.nanquantile(both[0][what][nominal == distance], shares)
    imitated = np.nanquantile(both[1][what][np.tile(nominal, DRAWS) == distance], shares)
    assert (imitated <= real * RATIO[what] + small).all(), (real, imitated)
    assert (real <= imitated * RATIO[what] + small).all(), (real, imitated)
