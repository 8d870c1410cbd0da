"""Views of markers in a room, as the rendered and as the projected camera see them: what several benchmarks share."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from tral_env.config import CameraConfig, CarConfig
from tral_env.course.plan import BOX_KINDS, Plan
from tral_env.course.scene import Pool, build_model, write_plan
from tral_env.perception.aruco import Detector, MarkerPoses, marker_poses
from tral_env.perception.camera import OnboardCamera
from tral_env.perception.degrade import ImageCorruption, degrade
from tral_env.perception.lens import project_points
from tral_env.perception.projected import (
    NOISE_PLACES,
    NORMALS,
    UNIFORMS,
    ProjectedMarkers,
    Scenery,
    project,
)
from tral_env.se2 import wrap

Array = NDArray[np.float64]
Columns = dict[str, Array]
Fault = tuple[float, ImageCorruption]
Marker = tuple[int, float, float, float, float]
"""Id, x, y, z [m], and yaw of the normal [rad], in the car's frame."""

LENS, CAR = CameraConfig(), CarConfig()
DISTANCES = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0)
MAX_ANGLE = 1.35
MARGIN_PX = 3.0
IDS = (*range(10), 40, 41, 42)
"""Ids of gates and of the signs at crossings; blur hides 0 and 9 before the others."""
_CORNERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))

CLEAR, WEBCAM = ImageCorruption(exposure=0, blur_px=0, glare=0, noise=0), ImageCorruption()
LEVELS: dict[str, Fault] = {"off": (0.0, WEBCAM), "mild": (1.0, WEBCAM), "strong": (3.0, WEBCAM)}
SINGLE: dict[str, Fault] = {
    "exposure": (3.0, replace(CLEAR, exposure=WEBCAM.exposure)),
    "blur": (3.0, replace(CLEAR, blur_px=WEBCAM.blur_px)),
    "glare": (3.0, replace(CLEAR, glare=WEBCAM.glare)),
    "noise": (3.0, replace(CLEAR, noise=WEBCAM.noise)),
    "streak": (3.0, replace(CLEAR, streak_px=2.0)),
    "patch": (3.0, replace(CLEAR, patch=0.1)),
}
"""Each fault alone, as strong as at level 3; streak and patch are no part of the levels."""


class MarkerRoom:
    """A room with up to two markers, and the car's camera in it."""

    def __init__(self, lens: CameraConfig = LENS) -> None:
        self.lens, self.pool = lens, Pool(3, 2)
        self.model = build_model(self.pool)
        self.data = mujoco.MjData(self.model)
        self.camera, self.detector = OnboardCamera(lens), Detector()
        self.image = np.zeros((lens.height, lens.width, 3), np.uint8)

    def show(self, markers: list[Marker]) -> None:
        """Render the room with these markers."""
        write_plan(self.model, room_plan(markers), self.pool)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        self.image = self.camera.capture(self.model, self.data)

    def search(self, fault: Fault, rng: np.random.Generator) -> MarkerPoses:
        """Markers that the detector finds in the image with a fault."""
        level, corruption = fault
        return marker_poses(self.detector.detect(degrade(self.image, level, rng, corruption)), self.lens, CAR)

    def close(self) -> None:
        """Free the OpenGL context."""
        self.camera.close()


def room_plan(markers: list[Marker]) -> Plan:
    """Three walls around the car, and the markers."""
    face = np.array([marker[1:] for marker in markers])
    return Plan(
        box_position=np.array([[6.0, 5.0, 1.2], [6.0, -5.0, 1.2], [12.0, 0.0, 1.2]]),
        box_yaw=np.zeros(3),
        box_size=np.array([[8.0, 0.05, 1.2], [8.0, 0.05, 1.2], [0.05, 5.0, 1.2]]),
        box_kind=np.full(3, BOX_KINDS.index("wall")),
        route=np.array([[0.0, 0.0], [1.0, 0.0]]),
        start=np.zeros(3),
        marker_position=face[:, :3],
        marker_yaw=face[:, 3],
        marker_id=np.array([marker[0] for marker in markers]),
    )


def views_of_markers(lens: CameraConfig, rng: np.random.Generator, count: int) -> Columns:
    """Random markers that lie wholly in the image, near `DISTANCES`; columns of about `count` values by name."""
    nominal = np.repeat(DISTANCES, math.ceil(2 * count / len(DISTANCES)))
    n, aside = len(nominal), math.atan(lens.width / 2 / lens.fx)
    distance, bearing = nominal * rng.uniform(0.93, 1.07, n), rng.uniform(-aside, aside, n)
    angle, z = rng.uniform(-MAX_ANGLE, MAX_ANGLE, n), rng.uniform(0.15, 0.3, n)
    heading, half = bearing + angle, lens.marker_size / 2
    side = half * np.stack([-np.sin(heading), np.cos(heading), np.zeros(n)], axis=1)
    middle = np.stack([distance * np.cos(bearing), distance * np.sin(bearing), z - CAR.camera_z], axis=1)
    up = np.array([0.0, 0.0, half])
    pixels = project_points(np.stack([middle + i * side + j * up for i, j in _CORNERS], axis=1), lens)
    inside = ((pixels > MARGIN_PX) & (pixels < [lens.width - 1 - MARGIN_PX, lens.height - 1 - MARGIN_PX])).all((1, 2))
    size = np.linalg.norm(pixels - np.roll(pixels, 1, axis=1), axis=2).min(axis=1)
    names = ("nominal", "distance", "bearing", "angle", "z", "heading", "size", "id")
    ids = rng.choice(IDS, n).astype(np.float64)
    views = dict(zip(names, (nominal, distance, bearing, angle, z, heading, size, ids), strict=True))
    keep = np.flatnonzero(inside)
    keep = keep[:: max(1, len(keep) // count)]
    return {name: values[keep] for name, values in views.items()}


def markers_of(views: Columns) -> list[Marker]:
    """The markers of the views."""
    x = CAR.camera_x + views["distance"] * np.cos(views["bearing"])
    y = views["distance"] * np.sin(views["bearing"])
    yaw = views["heading"] + math.pi
    return [(int(i), *map(float, row)) for i, *row in zip(views["id"], x, y, views["z"], yaw, strict=True)]


def rendered(
    lens: CameraConfig, views: Columns, faults: Mapping[str, Fault], rng: np.random.Generator
) -> dict[str, Columns]:
    """Errors of the rendered camera over views, by fault; NaN where the detector finds nothing."""
    room, found = MarkerRoom(lens), {name: np.full((len(views["distance"]), 3), np.nan) for name in faults}
    for row, marker in enumerate(markers_of(views)):
        room.show([marker])
        for name, fault in faults.items():
            poses = room.search(fault, rng)
            for k in np.flatnonzero(poses.ids == marker[0])[:1]:
                found[name][row] = poses.x[k], poses.y[k], poses.heading[k]
    room.close()
    return {name: errors(views, pose) for name, pose in found.items()}


def from_the_origin(scenery: Scenery, lens: CameraConfig, level: float, rng: np.random.Generator) -> ProjectedMarkers:
    """Markers that the projected cameras of cars at the origin see, each in its own scenery."""
    n = len(scenery.markers)
    return project(
        scenery,
        np.arange(n),
        np.zeros((n, 3)),
        lens,
        CAR,
        mounting=np.zeros((n, 3)),
        normal=rng.standard_normal((n, NOISE_PLACES, NORMALS)),
        uniform=rng.random((n, NOISE_PLACES, UNIFORMS)),
        degradation=np.full(n, level),
    )


def errors(views: Columns, pose: Array) -> Columns:
    """Errors along and across the line of sight as shares of the distance, and of the heading [rad]; NaN: not found."""
    ahead, left = pose[:, 0] - CAR.camera_x, pose[:, 1]
    cos, sin, distance = np.cos(views["bearing"]), np.sin(views["bearing"]), views["distance"]
    return {
        "range": (ahead * cos + left * sin) / distance - 1.0,
        "bearing": (left * cos - ahead * sin) / distance,
        "heading": np.asarray(wrap(pose[:, 2] - views["heading"])),
    }
