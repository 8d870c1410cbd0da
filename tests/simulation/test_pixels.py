"""The observed images: black at first, each shown when its latency is over."""

from collections.abc import Iterator

import numpy as np
import pytest
from one_car import GATE_AHEAD

from tral_env.config import CameraConfig
from tral_env.course.geometry import build_plan
from tral_env.course.scene import Pool
from tral_env.simulation.pixels import Pixels
from tral_env.simulation.render_scene import RenderScene

GATE = build_plan(GATE_AHEAD)
POOL = Pool.of(GATE)
LATENCY = np.array([0.05, 0.05])
BOTH = np.array([0, 1])


@pytest.fixture
def pixels(opengl: None) -> Iterator[Pixels]:
    made = Pixels(2, (64, 48), POOL, CameraConfig(), None)
    for row in range(2):
        made.place(row, GATE, 0.0, 7)
    yield made
    made.close()


def states(*places: float) -> np.ndarray:
    """Full states of cars that far along the corridor, (k, nq)."""
    qpos = np.repeat(RenderScene(POOL).data.qpos[None].copy(), len(places), axis=0)
    qpos[:, 0] = places
    return qpos


def at(time_s: float) -> np.ndarray:
    return np.full(2, time_s)


def test_images_are_black_before_the_first_arrives() -> None:
    images = Pixels(2, (64, 48), POOL, CameraConfig(), None).images
    assert (images.shape, images.dtype, images.max()) == ((2, 48, 64, 3), np.uint8, 0)


def test_an_image_is_shown_when_its_latency_is_over(pixels: Pixels) -> None:
    pixels.expose(BOTH, at(0.0), states(2.0, 3.0), np.zeros((2, 3)))
    pixels.deliver(at(0.04), LATENCY)
    assert pixels.images.max() == 0
    pixels.deliver(at(0.05), LATENCY)
    assert (pixels.images.reshape(2, -1).max(axis=1) > 0).all()
    assert not np.array_equal(pixels.images[0], pixels.images[1])


def test_images_arrive_in_the_order_in_which_they_were_exposed(pixels: Pixels) -> None:
    pixels.expose(BOTH, at(0.0), states(2.0, 2.0), np.zeros((2, 3)))
    pixels.deliver(at(0.05), LATENCY)
    first = pixels.images.copy()
    pixels.reset(BOTH)
    for time_s, place in ((0.0, 2.0), (0.02, 4.0)):
        pixels.expose(BOTH, at(time_s), states(place, place), np.zeros((2, 3)))
    pixels.deliver(at(0.06), LATENCY)
    assert np.array_equal(pixels.images, first)
    pixels.deliver(at(0.07), LATENCY)
    assert not np.array_equal(pixels.images, first)


def test_a_reset_forgets_what_is_shown_and_what_is_on_its_way(pixels: Pixels) -> None:
    pixels.expose(BOTH, at(0.0), states(2.0, 2.0), np.zeros((2, 3)))
    pixels.reset(np.array([0]))
    pixels.deliver(at(0.05), LATENCY)
    assert pixels.images[0].max() == 0
    assert pixels.images[1].max() > 0
    pixels.reset(np.array([1]))
    assert pixels.images.max() == 0
