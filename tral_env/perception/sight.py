"""What one image shows, for a person: markers and gates with their meaning and place, and what is wrong with them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array
from tral_env.config import CameraConfig, CarConfig
from tral_env.errors import ConfigError
from tral_env.interface import GATE_MARKER_IDS, TURN_MARKER_IDS
from tral_env.perception.aruco import DICTIONARY, Detector, MarkerCorners, fitting_dictionaries, marker_poses
from tral_env.perception.gate import nearest_gate_and_marker


@dataclass(frozen=True)
class Place:
    """Where something stands, seen from the camera."""

    distance: float
    """m along the ground."""
    bearing: float
    """rad, + = left of straight ahead."""
    heading: float
    """rad, + = left: direction into a marker or through a gate; 0 = straight ahead."""


@dataclass(frozen=True, eq=False)
class SeenMarker:
    """A marker in an image."""

    id: int
    meaning: str
    """Such as "gate 4, left" or "turn left"."""
    corners: Array
    """(4, 2) px, as in `MarkerCorners`."""
    place: Place | None
    """Where it stands, if the lens is known."""


@dataclass(frozen=True)
class SeenGate:
    """Both markers of a gate in an image."""

    number: int
    left: SeenMarker
    right: SeenMarker
    swapped: bool
    """Whether the left marker hangs on the right."""
    place: Place | None
    """Where its middle is, if the lens is known and the markers are not swapped."""


@dataclass(frozen=True)
class Sight:
    """What an image shows."""

    markers: tuple[SeenMarker, ...]
    """The markers, in the order of their ids."""
    gates: tuple[SeenGate, ...]
    problems: tuple[str, ...]
    """What is wrong and what to do about it, a sentence each."""


def seen_ids(image: NDArray[np.uint8]) -> tuple[int, ...]:
    """Ids of the markers in an image, ascending: what `look` finds, many times as fast where it would seek a reason.

    Args:
        image: (h, w) grey or (h, w, 3) RGB, uint8.
    """
    return tuple(sorted(Detector().detect(image).ids.tolist()))


def look(image: NDArray[np.uint8], lens: CameraConfig | None = None) -> Sight:
    """Find markers and gates in an image, and tell what is wrong with them.

    It takes long where no marker or half a gate is seen: it tries all dictionaries then.

    Args:
        image: (h, w) grey or (h, w, 3) RGB, uint8.
        lens: the lens, scaled to the image; None: no places are told.

    Raises:
        ConfigError: the image has other proportions than the lens, or the lens is none.
    """
    if lens is not None and not isinstance(lens, CameraConfig):
        raise ConfigError(f"lens = {lens!r}: expected a CameraConfig, such as load_lens gives, or None")
    found = Detector().detect(image)
    places = _places(found, fitted_lens(lens, image.shape[1], image.shape[0])) if lens else [None] * len(found.ids)
    seen = sorted(zip(found.ids, found.corners, places, strict=True), key=lambda one: int(one[0]))
    markers = tuple(SeenMarker(int(one), meaning(int(one)), corners, place) for one, corners, place in seen)
    counts = Counter(marker.id for marker in markers)
    by_id = {marker.id: marker for marker in markers if counts[marker.id] == 1}  # of two, one is not the gate's
    gates = tuple(
        _gate(by_id[left], by_id[left + 1]) for left in GATE_MARKER_IDS[::2] if left in by_id and left + 1 in by_id
    )
    if not markers:
        return Sight((), (), (_nothing(image),))
    is_half_seen = not gates and any(marker.id in GATE_MARKER_IDS for marker in markers)
    return Sight(markers, gates, (*_problems(markers, gates), *(_of_another(image) if is_half_seen else [])))


def meaning(marker: int) -> str:
    """What a marker tells the car."""
    if marker in GATE_MARKER_IDS:
        return f"gate {marker // 2}, {'right' if marker % 2 else 'left'}"
    turns = {number: way for way, number in TURN_MARKER_IDS.items()}
    if marker not in turns:
        return "no meaning"
    return "straight on" if turns[marker] == "straight" else f"turn {turns[marker]}"


def fitted_lens(lens: CameraConfig, width: int, height: int) -> CameraConfig:
    """The lens for an image of another size.

    Raises:
        ConfigError: the image has other proportions than the lens.
    """
    if abs(width * lens.height - height * lens.width) > max(lens.width, lens.height):
        raise ConfigError(
            f"the image is {width} x {height} px, the lens is for {lens.width} x {lens.height}, which has other "
            "proportions: calibrate the camera with such images"
        )
    return lens.scaled(width, height)


def _places(found: MarkerCorners, lens: CameraConfig) -> list[Place | None]:
    poses = marker_poses(found, lens)
    return [_place(*pose) for pose in zip(poses.x - CarConfig().camera_x, poses.y, poses.heading, strict=True)]


def _place(x: float, y: float, heading: float) -> Place:
    return Place(float(np.hypot(x, y)), float(np.arctan2(y, x)), float(heading))


def _gate(left: SeenMarker, right: SeenMarker) -> SeenGate:
    """A gate from its markers, which face the camera, so that the left one is seen on the left."""
    swapped = bool(left.corners[:, 0].mean() > right.corners[:, 0].mean())
    place = None
    if left.place and right.place and not swapped:
        posts = (left.place, right.place)
        x, y = (np.array([[one.distance * turn(one.bearing) for one in posts]]) for turn in (np.cos, np.sin))
        heading = np.array([[one.heading for one in posts]])
        seen = nearest_gate_and_marker(np.array([[left.id, right.id]]), x, y, heading, np.ones((1, 2), np.bool_))
        if seen.gate_seen[0]:
            place = _place(seen.gate_x[0], seen.gate_y[0], seen.gate_heading[0])
    return SeenGate(left.id // 2, left, right, swapped, place)


def _problems(markers: tuple[SeenMarker, ...], gates: tuple[SeenGate, ...]) -> list[str]:
    told = [
        f"gate {gate.number}: its boards hang left for right; in driving direction, marker {gate.left.id} belongs on "
        f"the left and marker {gate.right.id} on the right"
        for gate in gates
        if gate.swapped
    ]
    counts = Counter(marker.id for marker in markers)
    told += [
        f"marker {one} is there {count} times: each id may hang once" for one, count in counts.items() if count > 1
    ]
    for one in counts:
        if one in GATE_MARKER_IDS and one ^ 1 not in counts:
            told.append(f"gate {one // 2}: marker {one ^ 1}, its {'left' if one % 2 else 'right'} one, is not seen")
        elif meaning(one) == "no meaning":
            told.append(f"marker {one} means nothing: gates have 0 to 39, signs 40 to 42")
    return told


def _of_another(image: NDArray[np.uint8]) -> list[str]:
    """Word that markers of another dictionary are there beside one that may be false, if they are more than one."""
    fitting = [(name, count) for name, count in fitting_dictionaries(image, 2).items() if name != DICTIONARY]
    return [f"{count} markers of {name} are there too: is the other marker a false one?" for name, count in fitting[:1]]


def _nothing(image: NDArray[np.uint8]) -> str:
    """Word that no marker is seen, and which dictionary would fit."""
    fitting = fitting_dictionaries(image)
    if not fitting:
        return (
            f"no marker of {DICTIONARY} or any other dictionary: too far or too small (10 px or more are needed), "
            "blurred, cut off, without a white border, or printed mirrored?"
        )
    name, count = next(iter(fitting.items()))
    what = "1 marker" if count == 1 else f"{count} markers"
    board = ". Or is it a calibration board?" if count > 3 else ""
    return (
        f"no marker of {DICTIONARY}, but {what} of {name}: print them with tral print gate or tral print marker{board}"
    )
