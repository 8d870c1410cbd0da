"""False markers that the simulated cameras show."""

import math
from collections import Counter
from dataclasses import fields

import numpy as np
import pytest

from tral_env.config import CameraConfig, CarConfig
from tral_env.interface import MARKER_IDS, STRONG_GATES
from tral_env.perception.false_sightings import LIKELY_ID, FalseSightings
from tral_env.perception.gate import Detection
from tral_env.randomization import LEVELS

LENS, CAR = CameraConfig(), CarConfig()
ONE = np.array([0])


def source(rate: float, seed: int = 3, n: int = 1) -> FalseSightings:
    sightings = FalseSightings(n, LENS, CAR)
    for row in range(n):
        sightings.reset(row, rate, seed + row)
    return sightings


def markers(sightings: FalseSightings, images: int, row: int = 0) -> list[tuple[float, ...]]:
    """Id, x, y, heading that each of so many empty images shows."""
    out = []
    for _ in range(images):
        seen = Detection.nothing(1)
        sightings.add(np.array([row]), seen)
        out.append((seen.marker_id[0], seen.marker_x[0], seen.marker_y[0], seen.marker_heading[0]))
    return out


def test_without_a_rate_images_stay_as_they_are() -> None:
    assert set(markers(source(0.0), 2000)) == {(-1.0, 0.0, 0.0, 0.0)}


@pytest.mark.parametrize("rate", [0.02, 0.3, 1.0])
def test_the_rate_is_the_share_of_images(rate: float) -> None:
    images = 5000
    false = sum(marker[0] >= 0 for marker in markers(source(rate), images))
    assert abs(false - images * rate) <= 4.0 * math.sqrt(images * rate * (1.0 - rate))


def test_most_have_the_id_that_windows_have_and_the_others_any_id_of_a_course() -> None:
    ids = Counter(int(marker[0]) for marker in markers(source(1.0), 3000))
    assert set(ids) == set(MARKER_IDS)
    assert 0.77 < ids[LIKELY_ID] / 3000 < 0.84
    assert LIKELY_ID // 2 not in STRONG_GATES


def test_they_are_in_view_and_face_the_camera() -> None:
    _, x, y, heading = np.array(markers(source(1.0), 2000)).T
    ahead = x - CAR.camera_x
    distance, bearing = np.hypot(ahead, y), np.arctan2(y, ahead)
    assert 0.5 <= distance.min() < 0.6
    assert 4.9 < distance.max() <= 5.0
    assert np.abs(LENS.fx * np.tan(bearing)).max() <= LENS.width / 2
    assert np.abs(heading - bearing).max() <= 0.6


@pytest.mark.parametrize(("distance", "stays"), [(0.3, True), (9.0, False)])
def test_a_true_marker_is_replaced_only_if_it_is_farther_away(distance: float, stays: bool) -> None:
    seen = Detection.nothing(1)
    seen.marker_id[0], seen.marker_x[0] = 4, distance
    source(1.0).add(ONE, seen)
    assert (seen.marker_x[0] == distance) == stays


def test_gates_stay_as_they_are() -> None:
    seen = Detection.nothing(1)
    for value, field in enumerate(name.name for name in fields(seen) if name.name.startswith("gate")):
        getattr(seen, field)[0] = value
    source(1.0).add(ONE, seen)
    assert [seen.gate_id[0], seen.gate_x[0], seen.gate_y[0], seen.gate_heading[0]] == [0.0, 1.0, 2.0, 3.0]


def test_a_row_among_others_is_the_same_alone() -> None:
    many, images = source(0.3, n=4), 200
    together = []
    for k in range(images):
        rows = np.array([0, 2, 3]) if k % 2 else np.arange(4)
        seen = Detection.nothing(len(rows))
        many.add(rows, seen)
        i = int(np.flatnonzero(rows == 2)[0])
        together.append((seen.marker_id[i], seen.marker_x[i], seen.marker_y[i], seen.marker_heading[i]))
    assert together == markers(source(0.3, seed=5), images)


def test_a_reset_begins_anew() -> None:
    used = source(0.3)
    first = markers(used, 50)
    used.reset(0, 0.3, 3)
    assert markers(used, 50) == first
    used.reset(0, 0.3, 4)
    assert markers(used, 50) != first


def test_only_the_nominal_car_sees_none() -> None:
    rates = {name: randomization.false_sighting_rate for name, randomization in LEVELS.items()}
    assert rates == {"none": (0.0, 0.0), "default": (0.002, 0.002), "hard": (0.02, 0.02)}
