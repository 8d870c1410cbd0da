"""What a webcam does to an image."""

import numpy as np

from tral_env.perception.degrade import WebcamLaw, degrade

GREY = np.full((48, 64, 3), 128, np.uint8)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_level_0_leaves_the_image() -> None:
    assert degrade(GREY, 0.0, rng()) is GREY


def test_the_same_noise_gives_the_same_image() -> None:
    assert np.array_equal(degrade(GREY, 1.0, rng()), degrade(GREY, 1.0, rng()))


def test_noise_has_the_strength_of_its_level() -> None:
    law = WebcamLaw(exposure=0, glare=0)
    assert abs(degrade(GREY, 2.0, rng(), law)[..., 0].std() - 2 * law.noise) < 0.3


def test_exposure_stays_within_its_error() -> None:
    law = WebcamLaw(glare=0, noise=0)
    means = [degrade(GREY, 1.0, np.random.default_rng(seed), law).mean() / 128 for seed in range(40)]
    assert 0.87 < min(means) < 0.93
    assert 1.07 < max(means) < 1.13


def test_glare_brightens_the_upper_half_alone() -> None:
    image = degrade(GREY, 1.0, rng(), WebcamLaw(exposure=0, noise=0)).astype(int)
    assert image[0].mean() > 129
    assert image[24:].mean() == 128


def test_blur_softens_an_edge() -> None:
    edge = np.zeros((16, 16, 3), np.uint8)
    edge[:, 8:] = 200
    image = degrade(edge, 2.0, rng(), WebcamLaw(exposure=0, glare=0, noise=0))
    assert 0 < image[8, 7, 0] < image[8, 8, 0] < 200
