"""Dictionaries of markers by name, and those that fit an image."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tral_env.errors import ConfigError
from tral_env.perception.aruco import fitting_dictionaries
from tral_env.perception.dictionaries import (
    DICTIONARIES,
    dictionary,
    dictionary_name,
    families,
    marker_count,
    marker_modules,
)


def picture(name: str, ids: list[int]) -> np.ndarray:
    """Markers side by side, 60 px wide."""
    markers = [cv2.aruco.generateImageMarker(dictionary(name), one, 60) for one in ids]
    return np.hstack([np.pad(marker, 20, constant_values=255) for marker in markers]).astype(np.uint8)


@pytest.mark.parametrize("name", ["DICT_4X4_50", "4X4_50", "4x4_50", " dict_4x4_50"])
def test_a_dictionary_is_found_however_it_is_written(name: str) -> None:
    assert dictionary_name(name) == "DICT_4X4_50"


def test_an_unknown_dictionary_is_told_with_the_nearest() -> None:
    with pytest.raises(ConfigError, match="unknown dictionary '7X7_5': did you mean 'DICT_7X7_50'"):
        dictionary_name("7X7_5")


def test_each_dictionary_is_in_one_family() -> None:
    assert sorted(name for family in families() for name in family) == sorted(DICTIONARIES)
    assert ["DICT_5X5_50", "DICT_5X5_100", "DICT_5X5_250", "DICT_5X5_1000"] in families()


def test_sizes_of_a_dictionary() -> None:
    assert (marker_count("DICT_6X6_250"), marker_modules("DICT_6X6_250")) == (250, 8)


@pytest.mark.parametrize(
    ("name", "ids", "told"),
    [
        ("DICT_5X5_50", [3, 7], "DICT_5X5_50"),
        ("DICT_5X5_1000", [3, 70], "DICT_5X5_100"),
        ("DICT_6X6_1000", [999], "DICT_6X6_1000"),
        ("DICT_APRILTAG_36h11", [0, 1, 2], "DICT_APRILTAG_36h11"),
    ],
)
def test_the_smallest_dictionary_that_fits_is_told(name: str, ids: list[int], told: str) -> None:
    assert next(iter(fitting_dictionaries(picture(name, ids)).items())) == (told, len(ids))


def test_an_empty_image_fits_no_dictionary() -> None:
    assert fitting_dictionaries(np.full((200, 200), 128, np.uint8)) == {}
