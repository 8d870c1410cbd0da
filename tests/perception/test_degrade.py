"""What a webcam does to an image."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.errors import ConfigError
from tral_env.perception.degrade import PATCH_GREYS, ImageCorruption, degrade

CLEAR = ImageCorruption(exposure=0, blur_px=0, glare=0, noise=0)
GREY = np.full((48, 64, 3), 128, np.uint8)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_level_0_leaves_the_image() -> None:
    assert degrade(GREY, 0.0, rng()) is GREY


def test_the_same_noise_gives_the_same_image() -> None:
    assert np.array_equal(degrade(GREY, 1.0, rng()), degrade(GREY, 1.0, rng()))


def test_noise_has_the_strength_of_its_level() -> None:
    faults = ImageCorruption(exposure=0, glare=0)
    assert abs(degrade(GREY, 2.0, rng(), faults)[..., 0].std() - 2 * faults.noise) < 0.3


def test_exposure_stays_within_its_error() -> None:
    faults = ImageCorruption(glare=0, noise=0)
    means = [degrade(GREY, 1.0, np.random.default_rng(seed), faults).mean() / 128 for seed in range(40)]
    assert 0.87 < min(means) < 0.93
    assert 1.07 < max(means) < 1.13


def test_glare_brightens_the_upper_half_alone() -> None:
    image = degrade(GREY, 1.0, rng(), ImageCorruption(exposure=0, noise=0)).astype(int)
    assert image[0].mean() > 129
    assert image[24:].mean() == 128


def test_blur_softens_an_edge() -> None:
    edge = np.zeros((16, 16, 3), np.uint8)
    edge[:, 8:] = 200
    image = degrade(edge, 2.0, rng(), ImageCorruption(exposure=0, glare=0, noise=0))
    assert 0 < image[8, 7, 0] < image[8, 8, 0] < 200


def test_a_blur_too_small_for_a_number_is_none() -> None:
    assert np.array_equal(degrade(GREY, 0.4, rng(), replace(CLEAR, blur_px=5e-324)), GREY)


def test_a_streak_softens_upright_edges_alone() -> None:
    corner = np.zeros((40, 40, 3), np.uint8)
    corner[20:, 20:] = 200
    image = degrade(corner, 3.0, np.random.default_rng(1), replace(CLEAR, streak_px=4.0))
    assert 0 < image[30, 19, 0] <= image[30, 20, 0] < 200
    assert image[19].max() == 0
    assert image[20, 35, 0] == 200


def test_a_streak_keeps_the_brightness() -> None:
    dot = np.zeros((9, 41, 3), np.uint8)
    dot[4, 20] = 240
    for seed in range(10):
        image = degrade(dot, 1.0, np.random.default_rng(seed), replace(CLEAR, streak_px=6.0))
        assert abs(image[4, :, 0].astype(int).sum() - 240) <= 4


def test_a_streak_of_less_than_a_pixel_changes_nothing() -> None:
    image = np.random.default_rng(0).integers(0, 255, (20, 20, 3), np.uint8)
    assert np.array_equal(degrade(image, 1.0, rng(), replace(CLEAR, streak_px=1.0)), image)


@given(st.integers(0, 1000), st.floats(0.1, 3.0))
def test_a_patch_is_a_dark_or_bright_square_of_its_size_cut_at_the_edge(seed: int, level: float) -> None:
    image = degrade(GREY, level, np.random.default_rng(seed), replace(CLEAR, patch=0.25))
    rows, columns = np.nonzero(image[..., 0] != 128)
    side = round(0.25 * level * 48)
    assert side // 2 <= np.ptp(rows) + 1 <= side
    assert side // 2 <= np.ptp(columns) + 1 <= side
    assert len(rows) == (np.ptp(rows) + 1) * (np.ptp(columns) + 1)
    assert len(np.unique(image[rows, columns])) == 1
    assert image[rows[0], columns[0], 0] in PATCH_GREYS


@given(st.integers(0, 1000), st.floats(0.0, 10.0))
def test_light_never_turns_below_dark(seed: int, level: float) -> None:
    faults = replace(CLEAR, exposure=1.0)
    light = 1 + level * np.random.default_rng(seed).uniform(-1, 1)
    image = degrade(GREY, level, np.random.default_rng(seed), faults)
    assert abs(int(image[0, 0, 0]) - np.clip(128 * light, 0, 255)) <= 0.51
    assert len(np.unique(image)) == 1


@pytest.mark.parametrize(
    ("name", "value", "most"),
    [("patch", 1.5, "1"), ("streak_px", -2.0, "1000"), ("noise", float("nan"), "255"), ("blur_px", "2", "100")],
)
def test_a_strength_that_cannot_be_is_named_with_what_can(name: str, value: object, most: str) -> None:
    told = re.escape(f"ImageCorruption.{name} = {value!r}: expected a number from 0 to {most}")
    with pytest.raises(ConfigError, match=f"{told}$"):
        ImageCorruption(**{name: value})


def test_a_smaller_image_has_less_noise_and_shorter_blur_and_streak() -> None:
    faults = ImageCorruption(streak_px=2.0, patch=0.1).scaled(0.25)
    assert faults == ImageCorruption(blur_px=0.1, noise=0.625, streak_px=0.5, patch=0.1)


def test_a_larger_image_has_no_more_than_there_can_be() -> None:
    assert ImageCorruption(noise=200.0).scaled(2.0).noise == 255.0


def test_streak_and_patch_are_off_until_asked_for() -> None:
    assert ImageCorruption().streak_px == ImageCorruption().patch == 0.0
