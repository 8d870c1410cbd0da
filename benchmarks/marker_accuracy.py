"""How far, how surely and how exactly does the rendered detector place a marker?

Sweeps distance, offset and heading of one marker before the car in the rendered corridor, prints tables and the figures
that `tral_env.perception.projected.DetectorLaw` holds, and writes all to results/marker_accuracy.json.

    python benchmarks/marker_accuracy.py [--views 2500] [--seed 0]
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table

from tral_env.config import CameraConfig, CarConfig
from tral_env.course.plan import BOX_KINDS, Plan
from tral_env.course.scene import Pool, build_model, dress
from tral_env.interface import wrap_angle
from tral_env.perception.aruco import Detector, MarkerPoses, marker_poses
from tral_env.perception.camera import OnboardCamera
from tral_env.perception.gate import sight
from tral_env.perception.projected import LAW, project_points
from tral_fsm.bench.host import host

RESULTS = Path(__file__).parent / "results" / "marker_accuracy.json"
LENS, CAR = CameraConfig(), CarConfig()
DISTANCES = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)
ANGLES_DEG = (0, 30, 60, 75)


class Hall:
    """A hall with up to two markers, and the car's camera in it."""

    def __init__(self) -> None:
        self.pool = Pool(3, 2)
        self.model = build_model(self.pool)
        self.data = mujoco.MjData(self.model)
        self.camera, self.detector = OnboardCamera(LENS), Detector()
        self.image = np.zeros((LENS.height, LENS.width, 3), np.uint8)

    def show(self, markers: list[tuple[int, float, float, float, float]]) -> None:
        """Render markers: id, x, y, z, yaw of the normal."""
        face = np.array([marker[1:] for marker in markers])
        plan = Plan(
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
        dress(self.model, plan, self.pool)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        self.image = self.camera.capture(self.model, self.data)

    def measure(self, markers: list[tuple[int, float, float, float, float]]) -> MarkerPoses:
        """Render and search."""
        self.show(markers)
        return marker_poses(self.detector.detect(self.image), LENS, CAR)


def view(hall: Hall, distance: float, bearing: float, angle: float, z: float) -> dict[str, float] | None:
    """One marker: what was seen of it; None when it is not wholly in the image."""
    x, y = CAR.camera_x + distance * math.cos(bearing), distance * math.sin(bearing)
    heading = bearing + angle
    side, up = np.array([-math.sin(heading), math.cos(heading), 0.0]) * 0.09, np.array([0.0, 0.0, 0.09])
    middle = np.array([x - CAR.camera_x, y, z - CAR.camera_z])
    pixels = project_points(middle + np.array([side + up, -side + up, -side - up, side - up]), LENS)
    if not ((pixels > LAW.margin_px) & (pixels < [LENS.width - 4, LENS.height - 4])).all():
        return None
    poses = hall.measure([(7, x, y, z, heading + math.pi)])
    sides = np.linalg.norm(pixels - np.roll(pixels, 1, axis=0), axis=1)
    seen = {"distance": distance, "angle": angle, "size": float(sides.min()), "found": float(len(poses.ids) == 1)}
    if len(poses.ids) == 1:
        off_x, off_y = poses.x[0] - x, poses.y[0] - y
        seen["range"] = (off_x * math.cos(bearing) + off_y * math.sin(bearing)) / distance
        seen["bearing"] = (off_y * math.cos(bearing) - off_x * math.sin(bearing)) / distance
        seen["heading"] = float(wrap_angle(poses.heading[0] - heading))
    return seen


def sweep(hall: Hall, rng: np.random.Generator, views: int) -> dict[str, np.ndarray]:
    """Random views; arrays by name, NaN where the marker was not found."""
    rows = []
    for _ in range(views):
        distance = math.exp(rng.uniform(math.log(0.5), math.log(8.0)))
        row = view(hall, distance, rng.uniform(-0.5, 0.5), rng.uniform(-1.35, 1.35), rng.uniform(0.15, 0.3))
        if row is not None:
            rows.append(row)
    names = ("distance", "angle", "size", "found", "range", "bearing", "heading")
    return {name: np.array([row.get(name, math.nan) for row in rows]) for name in names}


def grid(hall: Hall, rng: np.random.Generator, repeats: int) -> list[dict[str, Any]]:
    """Detection rate and errors at fixed distances and angles to the line of sight, anywhere across the image."""
    table = []
    for distance, angle in itertools.product(DISTANCES, ANGLES_DEG):
        seen = []
        for _ in range(repeats):
            turn = math.radians(angle) * rng.choice([-1, 1]) + rng.uniform(-0.05, 0.05)
            row = view(hall, distance, rng.uniform(-0.35, 0.35), turn, rng.uniform(0.15, 0.3))
            if row is not None:
                seen.append(row)
        found = [row for row in seen if row["found"]]
        position = [math.hypot(row["range"], row["bearing"]) for row in found]
        table.append(
            {
                "distance_m": distance,
                "angle_deg": angle,
                "rate": len(found) / max(len(seen), 1),
                "position_percent": _quantiles([100 * share for share in position]),
                "heading_deg": _quantiles([math.degrees(abs(row["heading"])) for row in found]),
            }
        )
    return table


def _quantiles(values: list[float]) -> list[float] | None:
    return [float(np.quantile(values, share)) for share in (0.5, 0.95)] if values else None


def fit(seen: dict[str, np.ndarray]) -> dict[str, float]:
    """The figures of `DetectorLaw`, by maximum likelihood or as plain standard deviations."""
    found = seen["found"] > 0
    half, slope = _fit_rate(seen["size"], found)
    hit = {name: values[found] for name, values in seen.items()}
    noise, gain, flip = _fit_heading(hit)
    return {
        "half_found_px": half,
        "found_slope": slope,
        "size_noise_px": float(np.std(hit["range"] * hit["size"])),
        "size_bias_px": float(np.median(hit["range"] * hit["size"])),
        "bearing_noise_px": float(np.std(hit["bearing"]) * LENS.fx),
        "heading_noise_px": noise,
        "perspective_gain": gain,
        "flip_px": flip,
    }


def _fit_rate(size: np.ndarray, found: np.ndarray) -> tuple[float, float]:
    def likelihood(half: float, slope: float) -> float:
        # A few are missed for reasons other than size.
        rate = np.clip(0.995 / (1 + np.exp(-slope * (size - half))), 1e-6, 1)
        return float(np.log(np.where(found, rate, 1 - rate)).sum())

    best = max(itertools.product(np.arange(6, 14, 0.1), np.arange(0.1, 2.5, 0.03)), key=lambda p: likelihood(*p))
    return float(best[0]), float(best[1])


def _fit_heading(hit: dict[str, np.ndarray]) -> tuple[float, float, float]:
    depth, sine = LENS.marker_size / hit["distance"], np.abs(np.sin(hit["angle"]))
    face_on = LENS.fx * depth
    mirrored = wrap_angle(hit["heading"] + 2 * hit["angle"])
    erf = np.vectorize(math.erf)

    def normal(error: np.ndarray, spread: np.ndarray) -> np.ndarray:
        return np.exp(-0.5 * (error / spread) ** 2) / (spread * math.sqrt(2 * math.pi))

    def likelihood(noise: float, gain: float, flip: float) -> float:
        spread = np.minimum(noise / (face_on * np.sqrt(sine**2 + (gain * depth) ** 2)), 1.0)
        flips = 0.5 - 0.5 * erf(face_on * depth * sine / flip / math.sqrt(2))
        mix = (1 - flips) * normal(hit["heading"], spread) + flips * normal(mirrored, spread)
        return float(np.log(0.99 * mix + 0.01 / (2 * math.pi)).sum())

    choices = itertools.product(np.arange(0.2, 0.9, 0.05), np.arange(1.0, 12.0, 1.0), np.arange(0.1, 0.7, 0.06))
    noise, gain, flip = max(choices, key=lambda p: likelihood(*p))
    return float(noise), float(gain), float(flip)


def gates(hall: Hall, rng: np.random.Generator, repeats: int) -> list[dict[str, Any]]:
    """Errors of a gate's middle and axis: from the line between the markers, and from the markers' own headings."""
    table = []
    for distance in (1.5, 2.0, 3.0, 4.0, 5.0, 6.0):
        line, own, middle, seen = [], [], [], 0
        for _ in range(repeats):
            axis, y, width = rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(0.75, 1.3)
            side = np.array([-math.sin(axis), math.cos(axis)]) * width / 2
            poses = hall.measure(
                [(i, distance + s * side[0], y + s * side[1], 0.22, axis + math.pi) for i, s in ((0, 1), (1, -1))]
            )
            found = np.ones((1, len(poses.ids)), bool)
            gate = sight(poses.ids[None], poses.x[None], poses.y[None], poses.heading[None], found)
            if gate.gate_seen[0]:
                seen += 1
                line.append(math.degrees(abs(gate.gate_heading[0] - axis)))
                own.append(math.degrees(abs(poses.heading.mean() - axis)))
                middle.append(100 * math.hypot(gate.gate_x[0] - distance, gate.gate_y[0] - y))
        table.append(
            {
                "distance_m": distance,
                "rate": seen / repeats,
                "middle_cm": _quantiles(middle),
                "axis_from_line_deg": _quantiles(line),
                "axis_from_headings_deg": _quantiles(own),
            }
        )
    return table


def timing(hall: Hall, repeats: int = 40) -> dict[str, float]:
    """Milliseconds of each stage, median, two markers in view."""
    hall.measure([(0, 3.0, 0.5, 0.2, math.pi), (1, 3.0, -0.5, 0.2, math.pi)])
    detections = hall.detector.detect(hall.image)
    return {
        "render_ms": _median_ms(lambda: hall.camera.capture(hall.model, hall.data), repeats),
        "detect_ms": _median_ms(lambda: hall.detector.detect(hall.image), repeats),
        "poses_ms": _median_ms(lambda: marker_poses(detections, LENS, CAR), repeats),
    }


def _median_ms(work: Callable[[], object], repeats: int) -> float:
    spent = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        spent.append(1e3 * (time.perf_counter() - start))
    return float(np.median(spent))


def show(console: Console, title: str, rows: list[dict[str, Any]]) -> None:
    """Print rows as a table; pairs are median and 95 % quantile."""
    table = Table(title=title)
    for name in rows[0]:
        table.add_column(name, justify="right")
    for row in rows:
        table.add_row(*(_cell(value) for value in row.values()))
    console.print(table)


def _cell(value: Any) -> str:
    if isinstance(value, list):
        return " / ".join(f"{part:.2f}" for part in value)
    return "-" if value is None else f"{value:g}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=2500)
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rng, hall, console = np.random.default_rng(arguments.seed), Hall(), Console()
    result = {
        "timing": timing(hall),
        "markers": grid(hall, rng, arguments.repeats),
        "gates": gates(hall, rng, arguments.repeats),
        "fitted": fit(sweep(hall, rng, arguments.views)),
        "in_use": asdict(LAW),
        "host": host(),
        "arguments": vars(arguments),
    }
    show(console, "One marker (median / 95 %)", result["markers"])
    show(console, "A gate (median / 95 %)", result["gates"])
    show(console, "Time of a frame, 640 x 480, two markers", [result["timing"]])
    show(console, "Figures for DetectorLaw", [result["fitted"]])
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    console.print(f"written: {RESULTS}")


if __name__ == "__main__":
    main()
