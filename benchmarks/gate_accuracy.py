"""How exactly do the rendered and the projected camera place a gate?

The script sweeps distance, lateral offset and heading of a gate of two markers at each level of degradation, measures
the errors of its middle and its axis, prints tables and writes results/gate_accuracy.json.

    python benchmarks/gate_accuracy.py [--views 900] [--seed 0] [--out FILE]
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from error_tables import quantiles, show
from marker_views import CAR, LENS, LEVELS, Array, Columns, Marker, MarkerRoom, from_the_origin, room_plan
from numpy.typing import NDArray
from rich.console import Console

from tral_env.atomic import write_bytes
from tral_env.perception.gate import Detection, nearest_gate_and_marker
from tral_env.perception.projected import Scenery
from tral_env.se2 import wrap
from tral_fsm.evaluation.host import host

RESULTS = Path(__file__).parent / "results" / "gate_accuracy.json"
DISTANCES = (1.5, 2.0, 3.0, 4.0, 5.0, 6.0)


def views_of_gates(rng: np.random.Generator, count: int) -> Columns:
    """Random gates before the camera, at `DISTANCES`; columns (count,) by name, in the car's frame."""
    distance = np.resize(DISTANCES, count)
    n = len(distance)
    return {
        "distance": distance,
        "x": CAR.camera_x + distance * rng.uniform(0.95, 1.05, n),
        # Both markers of most gates lie in the image up to this offset.
        "y": distance * rng.uniform(-0.35, 0.35, n),
        "axis": np.radians(rng.uniform(-30, 30, n)),
        "width": rng.uniform(0.78, 1.38, n),
        "z": rng.uniform(0.15, 0.3, n),
        "id": rng.integers(0, 5, n).astype(np.float64),
    }


def gate_of(views: Columns, row: int) -> list[Marker]:
    """The two markers of a gate."""
    x, y, axis, width, z = (float(views[name][row]) for name in ("x", "y", "axis", "width", "z"))
    side = -math.sin(axis) * width / 2, math.cos(axis) * width / 2
    left = 2 * int(views["id"][row])
    return [(left + i, x + s * side[0], y + s * side[1], z, axis + math.pi) for i, s in ((0, 1), (1, -1))]


def rendered(views: Columns, rng: np.random.Generator) -> dict[str, Detection]:
    """Detections of the rendered camera, by level."""
    room, n = MarkerRoom(LENS), len(views["x"])
    seen = {name: Detection.nothing(n) for name in LEVELS}
    for row in range(n):
        room.show(gate_of(views, row))
        for name, fault in LEVELS.items():
            poses = room.search(fault, rng)
            valid = np.ones((1, len(poses.ids)), bool)
            found = nearest_gate_and_marker(poses.ids[None], poses.x[None], poses.y[None], poses.heading[None], valid)
            seen[name].put(np.array([row]), found)
    room.close()
    return seen


def projected(views: Columns, level: float, rng: np.random.Generator) -> Detection:
    """Detections of the projected camera at a level."""
    n = len(views["x"])
    scenery = Scenery(n)
    for row in range(n):
        scenery.place(row, room_plan(gate_of(views, row)))
    seen = from_the_origin(scenery, LENS, level, rng)
    return nearest_gate_and_marker(seen.ids, seen.x, seen.y, seen.heading, seen.valid)


def summary(views: Columns, seen: Detection, rows: NDArray[np.bool_]) -> dict[str, Any]:
    """Share of gates found; median and 95 % quantile of the errors of middle and axis, along and across the sight."""
    hit = rows & seen.gate_seen
    x, y = views["x"][hit] - CAR.camera_x, views["y"][hit]
    off_x, off_y = seen.gate_x[hit] - views["x"][hit], seen.gate_y[hit] - y
    distance = np.hypot(x, y)
    along, across = (off_x * x + off_y * y) / distance, (off_y * x - off_x * y) / distance
    axis = np.asarray(wrap(seen.gate_heading[hit] - views["axis"][hit]))
    return {
        "rate": round(float(hit.sum() / max(rows.sum(), 1)), 3),
        "along_cm": quantiles(100 * np.abs(along)),
        "across_cm": quantiles(100 * np.abs(across)),
        "axis_deg": quantiles(np.degrees(np.abs(axis))),
        "deviation": [deviation(along), deviation(across), deviation(axis)],
    }


def deviation(error: Array) -> float | None:
    """Standard deviation of a normal distribution with this 90 % quantile: a few mirrored headings do not count."""
    return round(float(np.quantile(np.abs(error), 0.9) / 1.645), 5) if len(error) else None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=900)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    rng, console = np.random.default_rng(arguments.seed), Console()
    views = views_of_gates(rng, arguments.views)
    seen = {"rendered": rendered(views, rng)}
    seen["projected"] = {name: projected(views, level, rng) for name, (level, _) in LEVELS.items()}
    tables: dict[str, list[dict[str, Any]]] = {"distance": [], "offset": [], "heading": []}
    for level, distance in itertools.product(LEVELS, DISTANCES):
        rows = views["distance"] == distance
        row: dict[str, Any] = {"level": level, "distance_m": distance, "views": int(rows.sum())}
        tables["distance"].append(row | {name: summary(views, levels[level], rows) for name, levels in seen.items()})
    for level, low in itertools.product(LEVELS, (0.0, 0.4, 0.8)):
        offset = np.abs(views["y"])
        rows = (views["distance"] == 3.0) & (offset >= low) & (offset < low + 0.4)
        row = {"level": level, "offset_m": f"{low:g} to {low + 0.4:g}"}
        tables["offset"].append(row | summary(views, seen["rendered"][level], rows))
    for level, low in itertools.product(LEVELS, (0, 10, 20)):
        turned = np.degrees(np.abs(views["axis"]))
        rows = (views["distance"] == 3.0) & (turned >= low) & (turned < low + 10)
        row = {"level": level, "heading_deg": f"{low} to {low + 10}"}
        tables["heading"].append(row | summary(views, seen["rendered"][level], rows))
    for title, table in tables.items():
        show(console, f"Gates by {title} (median / 95 %)", table)
    result = tables | {"views": arguments.views, "seed": arguments.seed, "host": host()}
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(arguments.out, (json.dumps(result) + "\n").encode("utf-8"))
    console.print(f"written: {arguments.out}")


if __name__ == "__main__":
    main()
