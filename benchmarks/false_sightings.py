"""How often does the detector see a marker where there is none, and what do stricter cells cost?

Draws images that hold no marker (textures; dark frames around bright panes, as windows, lamps and posters are) and
searches them; then renders real markers and searches those. Each `validBitIdThreshold` of OpenCV 5 gets a row of the
table. Writes results/false_sightings.json.

    python benchmarks/false_sightings.py [--images 2000] [--views 400] [--seed 0] [--out FILE]
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from marker_views import CAR, LENS, LEVELS, MarkerRoom, views_of_markers
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from tral_env.perception.aruco import Detector
from tral_env.perception.degrade import degrade
from tral_fsm.evaluation.files import prepare_folder, write_json
from tral_fsm.evaluation.host import host

Image = NDArray[np.uint8]

RESULTS = Path(__file__).parent / "results" / "false_sightings.json"
THRESHOLDS = (0.49, 0.4, 0.3, 0.2, 0.1)
"""Share of a cell's pixels that may be of the wrong colour; 0.49 is OpenCV's default."""
HEIGHT, WIDTH = LENS.height, LENS.width
DRAWN_LEVELS = (0.0, 1.0, 3.0)
"""Levels of image degradation, one image after the other."""


def noise(rng: np.random.Generator) -> Image:
    """Clouds of one size, made hard or left soft."""
    coarse = rng.standard_normal((HEIGHT // int(rng.integers(4, 24)), WIDTH // int(rng.integers(4, 24))))
    big = cv2.resize(coarse, (WIDTH, HEIGHT), interpolation=int(rng.choice([cv2.INTER_NEAREST, cv2.INTER_CUBIC])))
    return np.clip(128 + 80 * big, 0, 255).astype(np.uint8)


def tiles(rng: np.random.Generator) -> Image:
    """A wall of rectangles, each of a grey of its own, with or without joints."""
    image = np.zeros((HEIGHT, WIDTH), np.uint8)
    side, ratio, joint = rng.uniform(10, 90), rng.uniform(0.6, 1.8), int(rng.integers(0, 6))
    for top in np.arange(0, HEIGHT, side):
        for left in np.arange(0, WIDTH, side * ratio):
            low, high = (int(top) + joint, int(left) + joint), (int(top + side), int(left + side * ratio))
            image[low[0] : high[0], low[1] : high[1]] = rng.choice([20, 60, 200, 240])
    return _tilted(image, rng)


def panes(rng: np.random.Generator) -> Image:
    """Dark frames around bright panes with crossbars: windows, glass doors, lamps, posters."""
    image = np.full((HEIGHT, WIDTH), int(rng.integers(120, 220)), np.uint8)
    for _ in range(int(rng.integers(2, 9))):
        width, height = (int(side) for side in rng.uniform(20, 160, 2))
        if rng.random() < 0.5:
            height = width
        left, top = int(rng.integers(0, WIDTH - 20)), int(rng.integers(0, HEIGHT - 20))
        cv2.rectangle(image, (left, top), (left + width, top + height), int(rng.integers(0, 70)), -1)
        frame = rng.uniform(0.08, 0.38, 4) * np.array([width, height, width, height])
        inner = left + int(frame[0]), top + int(frame[1]), left + width - int(frame[2]), top + height - int(frame[3])
        cv2.rectangle(image, inner[:2], inner[2:], int(rng.integers(170, 256)), -1)
        for _ in range(int(rng.integers(0, 3))):
            bar = int(rng.integers(1, 2 + width // 8))
            if rng.random() < 0.5:
                at = int(rng.integers(inner[0], max(inner[2], inner[0] + 1)))
                cv2.line(image, (at, inner[1]), (at, inner[3]), int(rng.integers(0, 70)), bar)
            else:
                at = int(rng.integers(inner[1], max(inner[3], inner[1] + 1)))
                cv2.line(image, (inner[0], at), (inner[2], at), int(rng.integers(0, 70)), bar)
    return _tilted(image, rng)


def _tilted(image: Image, rng: np.random.Generator) -> Image:
    """The same, seen from aside."""
    corners = np.array([[0, 0], [WIDTH, 0], [WIDTH, HEIGHT], [0, HEIGHT]], np.float32)
    moved = (corners + rng.uniform(-0.15, 0.15, (4, 2)) * [WIDTH, HEIGHT]).astype(np.float32)
    matrix = cv2.getPerspectiveTransform(corners, moved)
    return np.asarray(cv2.warpPerspective(image, matrix, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REFLECT), np.uint8)


KINDS: dict[str, Callable[[np.random.Generator], Image]] = {"noise": noise, "tiles": tiles, "panes": panes}


def false_ids(images: int, seed: int) -> dict[str, Any]:
    """For each threshold and kind: the ids that were seen, and how often."""
    detectors = {threshold: Detector(valid_bit_threshold=threshold) for threshold in THRESHOLDS}
    seen: dict[str, dict[str, Counter[int]]] = {str(t): {kind: Counter() for kind in KINDS} for t in THRESHOLDS}
    for number, (kind, draw) in enumerate(KINDS.items()):
        rng = np.random.default_rng([seed, number])
        for i in range(images):
            colour = cv2.merge([draw(rng)] * 3)
            image = degrade(np.asarray(colour, np.uint8), DRAWN_LEVELS[i % len(DRAWN_LEVELS)], rng)
            for threshold, detector in detectors.items():
                seen[str(threshold)][kind].update(detector.detect(image).ids.tolist())
    return {t: {kind: dict(sorted(count.items())) for kind, count in kinds.items()} for t, kinds in seen.items()}


def found_share(views: int, seed: int) -> dict[str, dict[str, float]]:
    """For each threshold and level of degradation: the share of real markers that are found."""
    rng, room = np.random.default_rng(seed), MarkerRoom()
    detectors = {threshold: Detector(valid_bit_threshold=threshold) for threshold in THRESHOLDS}
    found = {str(t): dict.fromkeys(LEVELS, 0) for t in THRESHOLDS}
    drawn = views_of_markers(LENS, rng, views)
    count = len(drawn["id"])
    for i in range(count):
        view = {name: float(values[i]) for name, values in drawn.items()}
        x = CAR.camera_x + view["distance"] * np.cos(view["bearing"])
        y = view["distance"] * np.sin(view["bearing"])
        room.show([(int(view["id"]), x, y, view["z"], view["heading"] + np.pi)])
        for level, (amount, corruption) in LEVELS.items():
            image = degrade(room.image, amount, rng, corruption)
            for threshold, detector in detectors.items():
                found[str(threshold)][level] += int(view["id"] in detector.detect(image).ids)
    room.close()
    return {t: {level: hits / count for level, hits in levels.items()} for t, levels in found.items()}


def show(result: dict[str, Any], console: Console) -> None:
    """One row for each threshold."""
    table = Table(title=f"{result['images']} images of each kind without a marker, {result['views']} views of one")
    for name in ("threshold", *(f"false, {kind}" for kind in KINDS), "false ids", *(f"found, {x}" for x in LEVELS)):
        table.add_column(name, justify="right")
    for threshold, kinds in result["false"].items():
        ids = sorted({int(i) for kind in kinds.values() for i in kind})
        counts = [str(sum(kind.values())) for kind in kinds.values()]
        found = [f"{100 * share:.1f} %" for share in result["found"][threshold].values()]
        table.add_row(threshold, *counts, " ".join(map(str, ids)), *found)
    console.print(table)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--images", type=int, default=2000, help="images of each kind")
    parser.add_argument("--views", type=int, default=400, help="about so many views of a real marker")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    prepare_folder(args.out.parent)
    result = {
        "images": args.images, "views": args.views, "seed": args.seed, "host": host(),
        "false": false_ids(args.images, args.seed), "found": found_share(args.views, args.seed),
    }  # fmt: skip
    write_json(args.out, result)
    show(result, Console(width=160))


if __name__ == "__main__":
    main()
