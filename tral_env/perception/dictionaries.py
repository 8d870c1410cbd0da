"""The dictionaries of ArUco markers that OpenCV knows, by name."""

from __future__ import annotations

import re
from typing import Any

import cv2

from tral_env.errors import ConfigError, nearest


def _names() -> dict[str, int]:
    """Each dictionary once: OpenCV also spells those of AprilTag in capitals."""
    names = sorted((name for name in dir(cv2.aruco) if name.startswith("DICT_")), key=lambda name: name[::-1])
    by_number = {int(getattr(cv2.aruco, name)): name for name in names}
    return {by_number[number]: number for number in sorted(by_number)}


DICTIONARIES = _names()
"""Name of each dictionary and its number in OpenCV; of one family the smaller come first."""


def dictionary_name(name: str) -> str:
    """Find the name of a dictionary; "4x4_50" is "DICT_4X4_50".

    Raises:
        ConfigError: OpenCV has no such dictionary.
    """
    asked = "DICT_" + name.strip().upper().removeprefix("DICT_")
    for known in DICTIONARIES:
        if known.upper() == asked:
            return known
    raise ConfigError(f"unknown dictionary '{name}': {nearest(asked, DICTIONARIES)}")


def dictionary(name: str) -> Any:
    """Get a dictionary of OpenCV by its name in `DICTIONARIES`."""
    return cv2.aruco.getPredefinedDictionary(DICTIONARIES[name])


def marker_count(name: str) -> int:
    """Number of markers in a dictionary."""
    return int(dictionary(name).bytesList.shape[0])


def marker_modules(name: str) -> int:
    """Cells along a marker's edge: its code, and a border on each side."""
    return int(dictionary(name).markerSize) + 2


def families() -> list[list[str]]:
    """Names of dictionaries that share markers, the smallest first: DICT_4X4_100 begins with those of DICT_4X4_50."""
    found: dict[str, list[str]] = {}
    for name in DICTIONARIES:
        size = re.fullmatch(r"(DICT_\dX\d)_\d+", name)
        found.setdefault(size[1] if size else name, []).append(name)
    return list(found.values())
