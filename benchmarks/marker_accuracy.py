"""How far, how surely and how exactly are markers placed, by the rendered camera and by the projected one?

Sweeps distance, place in the image and heading of one marker before the car in the rendered corridor; every image is
searched as it is, at each level of degradation, and with each single fault. Prints tables, writes
results/marker_accuracy.json.

    python benchmarks/marker_accuracy.py [--views 1600] [--seed 0] [--out FILE]
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from tral_env.config import WIDE_LENS, CameraConfig, CarConfig
from tral_env.course.plan import BOX_KINDS, Plan
from tral_env.course.scene import Pool, apply_materials, build_model
from tral_env.perception.aruco import Detector, MarkerPoses, marker_poses
from tral_env.perception.camera import OnboardCamera
from tral_env.perception.degrade import ImageCorruption, degrade
from tral_env.perception.detection_model import DETECTION_MODEL
from tral_env.perception.projected import (
    NOISE_PLACES,
    NORMALS,
    UNIFORMS,
    ProjectedMarkers,
    Scenery,
    project,
    project_points,
)
from tral_env.se2 import wrap
from tral_fsm.bench.host import host

Array = NDArray[np.float64]
Columns = dict[str, Array]
Fault = tuple[float, ImageCorruption]
Marker = tuple[int, float, float, float, float]
"""Id, x, y, z, yaw of the normal."""

RESULTS = Path(__file__).parent / "results" / "marker_accuracy.json"
LENS, CAR = CameraConfig(), CarConfig()
LENSES = {"default": LENS, "wide": WIDE_LENS, "320 x 240": LENS.scaled(320, 240), "1280 x 960": LENS.scaled(1280, 960)}
DISTANCES = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0)
MAX_ANGLE = 1.35
MARGIN_PX = 3.0
IDS = (*range(10), 40, 41, 42)
"""Of gates and of the turn at a crossing. Codes differ: blurred, 0 and 9 are lost before the others."""

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
"""Every fault alone, as strong as the level 3 has it; streak and patch are no part of the levels."""


class Hall:
    """A hall with up to two markers, and the car's camera in it."""

    def __init__(self, lens: CameraConfig = LENS) -> None:
        self.lens, self.pool = lens, Pool(3, 2)
        self.model = build_model(self.pool)
        self.data = mujoco.MjData(self.model)
        self.camera, self.detector = OnboardCamera(lens), Detector()
        self.image = np.zeros((lens.height, lens.width, 3), np.uint8)

    def show(self, markers: list[Marker]) -> None:
        """Render markers."""
        apply_materials(self.model, hall_plan(markers), self.pool)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        self.image = self.camera.capture(self.model, self.data)

    def search(self, fault: Fault, rng: np.random.Generator) -> MarkerPoses:
        """The markers in the image, after a fault."""
        level, corruption = fault
        return marker_poses(self.detector.detect(degrade(self.image, level, rng, corruption)), self.lens, CAR)

    def close(self) -> None:
        """Free the OpenGL context."""
        self.camera.close()


def hall_plan(markers: list[Marker]) -> Plan:
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


def draw_views(lens: CameraConfig, rng: np.random.Generator, count: int) -> Columns:
    """Markers wholly in the image, near the distances of the tables; columns (about count,) by name."""
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


_CORNERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def markers_of(views: Columns) -> list[Marker]:
    """The markers of the views."""
    x = CAR.camera_x + views["distance"] * np.cos(views["bearing"])
    y = views["distance"] * np.sin(views["bearing"])
    yaw = views["heading"] + math.pi
    return [(int(i), *map(float, row)) for i, *row in zip(views["id"], x, y, views["z"], yaw, strict=True)]


def rendered(
    lens: CameraConfig, views: Columns, faults: Mapping[str, Fault], rng: np.random.Generator
) -> dict[str, Columns]:
    """What the detector makes of the views: fault -> x, y, heading, NaN where it finds nothing."""
    hall, found = Hall(lens), {name: np.full((len(views["distance"]), 3), np.nan) for name in faults}
    for row, marker in enumerate(markers_of(views)):
        hall.show([marker])
        for name, fault in faults.items():
            poses = hall.search(fault, rng)
            for k in np.flatnonzero(poses.ids == marker[0])[:1]:
                found[name][row] = poses.x[k], poses.y[k], poses.heading[k]
    hall.close()
    return {name: errors(views, pose) for name, pose in found.items()}


def projected(lens: CameraConfig, views: Columns, level: float, rng: np.random.Generator) -> Columns:
    """What the projected camera makes of the same views."""
    n = len(views["distance"])
    scenery = Scenery(n)
    for row, marker in enumerate(markers_of(views)):
        scenery.place(row, hall_plan([marker]))
    seen = from_the_origin(scenery, lens, level, rng)
    pose = np.stack([seen.x[:, 0], seen.y[:, 0], seen.heading[:, 0]], axis=1)
    return errors(views, np.where(seen.valid[:, :1], pose, np.nan))


def from_the_origin(scenery: Scenery, lens: CameraConfig, level: float, rng: np.random.Generator) -> ProjectedMarkers:
    """What the projected camera of cars at the origin makes of the scenery around each."""
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
    """Along and across the line of sight, as shares of the distance, and of the heading; NaN: not found."""
    ahead, left = pose[:, 0] - CAR.camera_x, pose[:, 1]
    cos, sin, distance = np.cos(views["bearing"]), np.sin(views["bearing"]), views["distance"]
    return {
        "range": (ahead * cos + left * sin) / distance - 1.0,
        "bearing": (left * cos - ahead * sin) / distance,
        "heading": np.asarray(wrap(pose[:, 2] - views["heading"])),
    }


def summary(seen: Columns, rows: NDArray[np.bool_]) -> dict[str, Any]:
    """Rate and errors over some of the views: median and 95 % quantile of what was found."""
    hit = rows & ~np.isnan(seen["range"])
    position = 100 * np.hypot(seen["range"][hit], seen["bearing"][hit])
    return {
        "rate": round(float(hit.sum() / max(rows.sum(), 1)), 3),
        "position_percent": quantiles(position),
        "bearing_deg": quantiles(np.degrees(np.abs(seen["bearing"][hit]))),
        "heading_deg": quantiles(np.degrees(np.abs(seen["heading"][hit]))),
    }


def quantiles(values: Array) -> list[float] | None:
    """Median and 95 % quantile; None of nothing."""
    return [round(float(np.quantile(values, share)), 3) for share in (0.5, 0.95)] if len(values) else None


ANGLES = {"0 to 25": (0, 25), "25 to 50": (25, 50), "50 to 77": (50, 78)}
"""Between the marker's normal and the line of sight, deg; a car that drives to a gate sees the first."""


def by_distance(views: Columns, levels: dict[str, dict[str, Columns]]) -> list[dict[str, Any]]:
    """Rows by level, angle, distance; levels: level -> camera -> errors."""
    table = []
    for (level, cameras), (angle, (low, high)) in itertools.product(levels.items(), ANGLES.items()):
        turned = np.degrees(np.abs(views["angle"]))
        for distance in DISTANCES:
            rows = (views["nominal"] == distance) & (turned >= low) & (turned < high)
            if rows.any():
                row = {"level": level, "angle_deg": angle, "distance_m": distance, "views": int(rows.sum())}
                table.append(row | {name: summary(seen, rows) for name, seen in cameras.items()})
    return table


def by_offset(views: Columns, levels: dict[str, Columns]) -> list[dict[str, Any]]:
    """Rows by the lateral offset of a marker 3 m ahead, up to 50 degrees to the line of sight."""
    table = []
    offset = np.abs(views["distance"] * np.sin(views["bearing"]))
    for (level, seen), low in itertools.product(levels.items(), (0.0, 0.4, 0.8, 1.2)):
        rows = (views["nominal"] == 3.0) & (offset >= low) & (offset < low + 0.4) & (np.abs(views["angle"]) < 0.87)
        table.append({"level": level, "offset_m": f"{low:g} to {low + 0.4:g}"} | summary(seen, rows))
    return table


def by_fault(views: Columns, faults: dict[str, Columns]) -> list[dict[str, Any]]:
    """Rows by fault and distance, up to 50 degrees to the line of sight."""
    table = []
    for (fault, seen), distance in itertools.product(faults.items(), (3.0, 4.0, 5.0)):
        rows = (views["nominal"] == distance) & (np.abs(views["angle"]) < 0.87)
        table.append({"fault": fault, "distance_m": distance} | summary(seen, rows))
    return table


def timing(lens: CameraConfig, repeats: int = 80) -> dict[str, Any]:
    """Milliseconds of each stage, two markers in view: 10 % quantile (other work slows the rest) and median."""
    hall, rng = Hall(lens), np.random.default_rng(0)
    hall.show([(0, 3.0, 0.5, 0.2, math.pi), (1, 3.0, -0.5, 0.2, math.pi)])
    webcam = degrade(hall.image, 1.0, rng)
    detections = hall.detector.detect(webcam)
    stages = {
        "render_ms": _spent_ms(lambda: hall.camera.capture(hall.model, hall.data), repeats),
        "degrade_ms": _spent_ms(lambda: degrade(hall.image, 1.0, rng), repeats),
        "detect_ms": _spent_ms(lambda: hall.detector.detect(webcam), repeats),
        "pose_ms": _spent_ms(lambda: marker_poses(detections, lens, CAR), repeats),
    }
    hall.close()
    return stages | {"markers": len(detections.ids)}


def _spent_ms(work: Callable[[], object], repeats: int) -> list[float]:
    spent = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        spent.append(1e3 * (time.perf_counter() - start))
    return [round(float(np.quantile(spent, share)), 2) for share in (0.1, 0.5)]


def measure(lens: CameraConfig, rng: np.random.Generator, count: int, single: bool) -> dict[str, Any]:
    """All tables of one lens."""
    views = draw_views(lens, rng, count)
    seen = rendered(lens, views, LEVELS | SINGLE if single else LEVELS, rng)
    levels = {
        name: {"rendered": seen[name], "projected": projected(lens, views, level, rng)}
        for name, (level, _) in LEVELS.items()
    }
    tables = {"distance": by_distance(views, levels)}
    if single:
        tables["offset"] = by_offset(views, {name: seen[name] for name in LEVELS})
        tables["fault"] = by_fault(views, {name: seen[name] for name in ("off", *SINGLE)})
    return tables


def show(console: Console, title: str, rows: list[dict[str, Any]]) -> None:
    """Print rows as a table; pairs are median and 95 % quantile."""
    flat = [_flat(row) for row in rows]
    table = Table(title=title)
    for name in flat[0]:
        table.add_column(name, justify="right")
    for row in flat:
        table.add_row(*(_cell(value) for value in row.values()))
    console.print(table)


def _flat(row: dict[str, Any]) -> dict[str, Any]:
    """A row whose inner mappings became columns of their own."""
    out: dict[str, Any] = {}
    for name, value in row.items():
        inner = {f"{name} {k}": v for k, v in value.items()} if isinstance(value, dict) else {name: value}
        out.update(inner)
    return out


def _cell(value: Any) -> str:
    if isinstance(value, list):
        return " / ".join("-" if part is None else f"{part:.4g}" for part in value)
    return "-" if value is None else value if isinstance(value, str) else f"{value:g}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=1600, help="of the default lens; the others take a third")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    console, result = Console(), {}
    for name, lens in LENSES.items():
        rng, count = np.random.default_rng(arguments.seed), arguments.views if lens is LENS else arguments.views // 3
        result[name] = measure(lens, rng, count, single=lens is LENS) | {"timing": timing(lens)}
        for title in set(result[name]) - {"timing"}:
            show(console, f"{name} lens, by {title} (median / 95 %)", result[name][title])
        show(console, f"{name} lens: time of a frame", [result[name]["timing"]])
    result |= {"law": asdict(DETECTION_MODEL), "views": arguments.views, "seed": arguments.seed, "host": host()}
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(json.dumps(result) + "\n", encoding="utf-8")
    console.print(f"written: {arguments.out}")


if __name__ == "__main__":
    main()
