"""Which parameters of `DetectionModel` fit the rendered detector best?

The script renders one marker in many views at each of the model's levels of image degradation, and prints the fitted
parameters beside those in use, and writes results/detector_fit.json.

    python benchmarks/detector_fit.py [--views 2400] [--seed 1] [--codes 50] [--out FILE]
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from marker_views import LENS, WEBCAM, Array, Columns, rendered, views_of_markers
from rich.console import Console
from rich.table import Table

from tral_env.interface import MARKER_IDS
from tral_env.perception.detection_model import DETECTION_MODEL
from tral_env.se2 import wrap
from tral_fsm.evaluation.host import host

RESULTS = Path(__file__).parent / "results" / "detector_fit.json"

MAX_FITTED_ANGLE = 1.0
"""Views at a larger angle do not count, rad: there the errors do not follow from the size in the image."""
MAX_FITTED_PX = 40.0
"""Larger markers (root of their area) do not count for the position: their many errors of millimetres would outweigh
the errors that matter."""
STRAY_SHARE = 0.015
"""Share of headings with errors that the model does not explain."""


def fit(views: Columns, seen: Columns) -> dict[str, float]:
    """The parameters that fit one level."""
    counted = np.abs(views["angle"]) < MAX_FITTED_ANGLE
    found = ~np.isnan(seen["range"])
    half, slope = _fit_rate(views["size"][counted], found[counted])
    extent = LENS.fx * LENS.marker_size / views["distance"] * np.sqrt(np.cos(views["angle"]))
    far = counted & found & (extent < MAX_FITTED_PX)
    soft = DETECTION_MODEL.softness(extent, DETECTION_MODEL.sharp_share)
    size_error = seen["range"][far] * extent[far] / soft[far]
    bearing = seen["bearing"][far] * LENS.fx / soft[far]
    hit = counted & found
    noise, gain, flip = _fit_heading(views["distance"][hit], views["angle"][hit], seen["heading"][hit], soft[hit])
    return {
        "half_found_px": half,
        "found_slope": slope,
        "size_bias_px": float(np.median(size_error)),
        "size_noise_px": float(np.std(size_error)),
        "bearing_noise_px": float(np.std(bearing)),
        "heading_noise_px": noise,
        "perspective_gain": gain,
        "flip_px": flip,
    }


def weakness(rng: np.random.Generator, count: int) -> list[float]:
    """Weakness of each id in courses: how much larger it must be in a strongly degraded image."""
    views = views_of_markers(LENS, rng, 12 * count)
    limit = (views["nominal"] >= 3.0) & (np.abs(views["angle"]) < MAX_FITTED_ANGLE)
    views = {name: values[limit][:count] for name, values in views.items()}
    usual, share, slope = (
        DETECTION_MODEL.half_found_px[-1],
        DETECTION_MODEL.code_share[-1],
        DETECTION_MODEL.found_slope[-1],
    )
    out = []
    for marker in MARKER_IDS:
        views["id"] = np.full(len(views["id"]), float(marker))
        seen = rendered(LENS, views, {"strong": (DETECTION_MODEL.levels[-1], WEBCAM)}, rng)["strong"]
        half, _ = _fit_rate(views["size"], ~np.isnan(seen["range"]), slopes=(slope,))
        out.append(round((half / usual - 1) / share, 1))
    return out


def _best(likelihood: Callable[..., float], *grids: Iterable[float]) -> tuple[float, ...]:
    """The point of a grid with the largest likelihood."""
    return tuple(float(value) for value in max(itertools.product(*grids), key=lambda point: likelihood(*point)))


def _fit_rate(size: Array, found: np.ndarray, slopes: Iterable[float] = np.arange(0.2, 1.5, 0.05)) -> tuple[float, ...]:
    def likelihood(half: float, slope: float) -> float:
        rate = np.clip(DETECTION_MODEL.always_found / (1 + np.exp(-slope * (size - half))), 1e-6, 1 - 1e-6)
        return float(np.log(np.where(found, rate, 1 - rate)).sum())

    return _best(likelihood, np.arange(6, 28, 0.1), slopes)


def _fit_heading(distance: Array, angle: Array, error: Array, soft: Array) -> tuple[float, ...]:
    depth, sine = LENS.marker_size / distance, np.abs(np.sin(angle))
    face_on, mirrored = LENS.fx * depth, wrap(error + 2 * angle)
    erf = np.vectorize(math.erf)

    def likelihood(noise: float, gain: float, flip: float) -> float:
        spread = np.minimum(noise * soft / (face_on * np.sqrt(sine**2 + (gain * depth) ** 2)), 1.0)
        flips = 0.5 - 0.5 * erf(face_on * depth * sine / (flip * soft) / math.sqrt(2))
        mix = (1 - flips) * _normal(error, spread) + flips * _normal(np.asarray(mirrored), spread)
        return float(np.log((1 - STRAY_SHARE) * mix + STRAY_SHARE / (2 * math.pi)).sum())

    first = _best(likelihood, np.geomspace(0.3, 1.6, 7), np.geomspace(1.0, 5.0, 6), np.geomspace(0.2, 2.0, 7))
    return _best(likelihood, *(value * np.linspace(0.8, 1.25, 7) for value in first))


def _normal(error: Array, spread: Array) -> Array:
    return np.exp(-0.5 * (error / spread) ** 2) / (spread * math.sqrt(2 * math.pi))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=2400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--codes", type=int, default=0, help="views of each id, to fit the weakness of codes as well")
    parser.add_argument("--out", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    views = views_of_markers(LENS, rng, arguments.views)
    seen = rendered(LENS, views, {f"{level:g}": (level, WEBCAM) for level in DETECTION_MODEL.levels}, rng)
    fitted = {level: fit(views, errors) for level, errors in seen.items()}
    table = Table("figure", *(f"level {level}: fitted / in use" for level in fitted))
    for name in fitted["0"]:
        pairs = zip(fitted.values(), getattr(DETECTION_MODEL, name), strict=True)
        table.add_row(name, *(f"{figures[name]:.3g} / {used:g}" for figures, used in pairs))
    console = Console()
    console.print(table)
    result: dict[str, Any] = {"fitted": fitted, "in_use": asdict(DETECTION_MODEL)}
    if arguments.codes:
        result["weakness"] = weakness(rng, arguments.codes)
        console.print("weakness", result["weakness"])
    result |= {"views": arguments.views, "codes": arguments.codes, "seed": arguments.seed, "host": host()}
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(json.dumps(result) + "\n", encoding="utf-8")
    console.print(f"written: {arguments.out}")


if __name__ == "__main__":
    main()
