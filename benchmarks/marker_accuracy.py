"""How often and how exactly do the rendered and the projected camera place a marker, and up to which distance?

The script sweeps distance, place in the image and heading of one marker before the car. It searches each image at each
level of degradation and with each single fault, prints tables and writes results/marker_accuracy.json.

    python benchmarks/marker_accuracy.py [--views 1600] [--seed 0] [--out FILE]
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from error_tables import quantiles, show
from marker_views import (
    CAR,
    DISTANCES,
    LENS,
    LEVELS,
    SINGLE,
    Columns,
    MarkerRoom,
    errors,
    from_the_origin,
    markers_of,
    rendered,
    room_plan,
    views_of_markers,
)
from numpy.typing import NDArray
from rich.console import Console

from tral_env.atomic import write_bytes
from tral_env.config import WIDE_LENS, CameraConfig
from tral_env.perception.aruco import marker_poses
from tral_env.perception.degrade import degrade
from tral_env.perception.detection_model import DETECTION_MODEL
from tral_env.perception.projected import Scenery
from tral_fsm.bench.timing import Contestant, take_turns
from tral_fsm.evaluation.host import host

RESULTS = Path(__file__).parent / "results" / "marker_accuracy.json"
LENSES = {"default": LENS, "wide": WIDE_LENS, "320 x 240": LENS.scaled(320, 240), "1280 x 960": LENS.scaled(1280, 960)}


def projected(lens: CameraConfig, views: Columns, level: float, rng: np.random.Generator) -> Columns:
    """Errors of the projected camera over the same views."""
    n = len(views["distance"])
    scenery = Scenery(n)
    for row, marker in enumerate(markers_of(views)):
        scenery.place(row, room_plan([marker]))
    seen = from_the_origin(scenery, lens, level, rng)
    pose = np.stack([seen.x[:, 0], seen.y[:, 0], seen.heading[:, 0]], axis=1)
    return errors(views, np.where(seen.valid[:, :1], pose, np.nan))


def summary(seen: Columns, rows: NDArray[np.bool_]) -> dict[str, Any]:
    """Share of some views in which the marker was found; median and 95 % quantile of the errors there."""
    hit = rows & ~np.isnan(seen["range"])
    position = 100 * np.hypot(seen["range"][hit], seen["bearing"][hit])
    return {
        "rate": round(float(hit.sum() / max(rows.sum(), 1)), 3),
        "position_percent": quantiles(position),
        "bearing_deg": quantiles(np.degrees(np.abs(seen["bearing"][hit]))),
        "heading_deg": quantiles(np.degrees(np.abs(seen["heading"][hit]))),
    }


ANGLES = {"0 to 25": (0, 25), "25 to 50": (25, 50), "50 to 77": (50, 78)}
"""Ranges of the angle between the marker's normal and the line of sight, deg; cars before a gate see the first."""


def by_distance(views: Columns, levels: dict[str, dict[str, Columns]]) -> list[dict[str, Any]]:
    """Rows of the table by level, angle and distance; `levels` maps level -> camera -> errors."""
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
    """Rows by lateral offset of a marker 3 m ahead, at up to 50 degrees to the line of sight."""
    table = []
    offset = np.abs(views["distance"] * np.sin(views["bearing"]))
    for (level, seen), low in itertools.product(levels.items(), (0.0, 0.4, 0.8, 1.2)):
        rows = (views["nominal"] == 3.0) & (offset >= low) & (offset < low + 0.4) & (np.abs(views["angle"]) < 0.87)
        table.append({"level": level, "offset_m": f"{low:g} to {low + 0.4:g}"} | summary(seen, rows))
    return table


def by_fault(views: Columns, faults: dict[str, Columns]) -> list[dict[str, Any]]:
    """Rows by fault and distance, at up to 50 degrees to the line of sight."""
    table = []
    for (fault, seen), distance in itertools.product(faults.items(), (3.0, 4.0, 5.0)):
        rows = (views["nominal"] == distance) & (np.abs(views["angle"]) < 0.87)
        table.append({"fault": fault, "distance_m": distance} | summary(seen, rows))
    return table


def timing(lens: CameraConfig, rounds: int) -> dict[str, Any]:
    """Time of each stage with two markers in view, ms, over turns that the stages take.

    `median` is over all turns; other work on the computer hardly slows `fastest_tenth`, the 10 % quantile.
    """
    room, rng = MarkerRoom(lens), np.random.default_rng(0)
    room.show([(0, 3.0, 0.5, 0.2, math.pi), (1, 3.0, -0.5, 0.2, math.pi)])
    webcam = degrade(room.image, 1.0, rng)
    detections = room.detector.detect(webcam)
    stages = [
        stage("render_ms", lambda: room.camera.capture(room.model, room.data)),
        stage("degrade_ms", lambda: degrade(room.image, 1.0, rng)),
        stage("detect_ms", lambda: room.detector.detect(webcam)),
        stage("pose_ms", lambda: marker_poses(detections, lens, CAR)),
    ]
    take_turns(stages, rounds=rounds, seconds=0.05)
    room.close()
    return {each.name: spent_ms(each) for each in stages} | {"markers": len(detections.ids)}


def stage(name: str, work: Callable[[], object]) -> Contestant:
    """A stage whose calls are counted."""

    def step() -> int:
        work()
        return 1

    return Contestant(name=name, step=step)


def spent_ms(timed: Contestant) -> dict[str, float]:
    """Time of a call."""
    spent = 1e3 / np.array(timed.wall)
    return {
        "median": round(float(np.median(spent)), 2),
        "fastest_tenth": round(float(np.quantile(spent, 0.1)), 2),
    }


def measure(lens: CameraConfig, rng: np.random.Generator, count: int, single: bool) -> dict[str, Any]:
    """All tables of one lens."""
    views = views_of_markers(lens, rng, count)
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=1600, help="views of the default lens; the others have a third")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    console, result = Console(), {}
    rounds = max(2, arguments.views // 80)  # turns of each stage whose time is taken: 20 by default
    for name, lens in LENSES.items():
        rng, count = np.random.default_rng(arguments.seed), arguments.views if lens is LENS else arguments.views // 3
        result[name] = measure(lens, rng, count, single=lens is LENS) | {"timing": timing(lens, rounds)}
        for title in set(result[name]) - {"timing"}:
            show(console, f"{name} lens, by {title} (median / 95 %)", result[name][title])
        show(console, f"{name} lens: time of a frame", [result[name]["timing"]])
    result |= {"model": asdict(DETECTION_MODEL), "views": arguments.views, "seed": arguments.seed, "host": host()}
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(arguments.out, (json.dumps(result) + "\n").encode("utf-8"))
    console.print(f"written: {arguments.out}")


if __name__ == "__main__":
    main()
