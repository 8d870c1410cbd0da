"""What an image shows, told for a person."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from photo import photograph

from tral_env.config import WIDE_LENS, CameraConfig
from tral_env.errors import ConfigError
from tral_env.perception.sight import fitted_lens, look, meaning

LENS = CameraConfig()


@pytest.mark.parametrize(
    ("marker", "told"),
    [
        (8, "gate 4, left"),
        (39, "gate 19, right"),
        (40, "turn left"),
        (41, "turn right"),
        (42, "straight on"),
        (43, "no meaning"),
    ],
)
def test_the_meaning_of_a_marker(marker: int, told: str) -> None:
    assert meaning(marker) == told


def test_a_gate_is_told_with_its_place() -> None:
    sight = look(photograph([(8, 3.0, 0.6), (9, 3.0, -0.4)]), LENS)
    (gate,) = sight.gates
    assert (gate.number, gate.swapped, sight.problems) == (4, False, ())
    assert gate.place
    assert gate.place.distance == pytest.approx(np.hypot(3.0, 0.1), rel=0.02)
    assert gate.place.bearing == pytest.approx(np.arctan2(0.1, 3.0), abs=0.002)
    assert gate.place.heading == pytest.approx(0.0, abs=0.05)


def test_boards_hung_left_for_right_are_told() -> None:
    for lens in (None, LENS):
        sight = look(photograph([(9, 3.0, 0.6), (8, 3.0, -0.4)]), lens)
        assert [(gate.swapped, gate.place) for gate in sight.gates] == [(True, None)]
        assert "gate 4: its boards hang left for right" in sight.problems[0]
        assert "marker 8 belongs on the left" in sight.problems[0]


@pytest.mark.parametrize(
    ("markers", "problem"),
    [
        ([(8, 2.0, 0.2)], "gate 4: marker 9, its right one, is not seen"),
        ([(9, 2.0, 0.2)], "gate 4: marker 8, its left one, is not seen"),
        ([(45, 2.0, 0.2)], "marker 45 means nothing"),
        ([(40, 2.0, 0.5), (40, 2.0, -0.5)], "marker 40 is there 2 times"),
    ],
)
def test_what_is_wrong_with_markers_is_told(markers: list[tuple[int, float, float]], problem: str) -> None:
    assert [told.startswith(problem) for told in look(photograph(markers)).problems] == [True]


def test_a_sign_is_nothing_wrong() -> None:
    assert look(photograph([(40, 2.0, 0.2)])).problems == ()


def test_without_a_lens_there_are_no_places() -> None:
    sight = look(photograph([(8, 3.0, 0.6), (9, 3.0, -0.4)]))
    assert [part.place for part in (*sight.markers, *sight.gates)] == [None, None, None]


@settings(max_examples=15, deadline=None)
@given(st.floats(1.0, 4.0), st.floats(-0.4, 0.4), st.sampled_from([8, 20, 40]))
def test_a_marker_is_told_where_it_stands(ahead: float, aside: float, marker: int) -> None:
    (seen,) = look(photograph([(marker, ahead, aside * ahead)]), LENS).markers
    assert seen.id == marker
    assert seen.place
    assert seen.place.distance == pytest.approx(np.hypot(ahead, aside * ahead), rel=0.03)
    assert seen.place.bearing == pytest.approx(np.arctan(aside), abs=0.003)


@pytest.mark.parametrize("name", ["DICT_5X5_50", "DICT_6X6_250", "DICT_APRILTAG_36h11"])
def test_another_dictionary_is_told(name: str) -> None:
    sight = look(photograph([(8, 1.5, 0.3), (9, 1.5, -0.3)], name=name))
    family = name.replace("250", "50")
    assert sight.markers == ()
    assert sight.problems[0].startswith(f"no marker of DICT_4X4_50, but 2 markers of {family}: print them with")


def test_nothing_at_all_is_told_with_what_may_be_the_reason() -> None:
    (problem,) = look(np.full((480, 640), 128, np.uint8)).problems
    assert problem.startswith("no marker of DICT_4X4_50 or any other dictionary: too far or too small")


def test_an_image_of_another_size_scales_the_lens() -> None:
    large = LENS.scaled(1280, 960)
    image = photograph([(40, 2.0, 0.3)], large)
    (scaled,), (known,) = (look(image, lens).markers for lens in (LENS, large))
    assert scaled.place == known.place
    assert fitted_lens(WIDE_LENS, 640, 480) == WIDE_LENS


def test_an_image_of_other_proportions_is_refused() -> None:
    with pytest.raises(ConfigError, match="the image is 640 x 360 px, the lens is for 640 x 480"):
        look(np.zeros((360, 640), np.uint8), LENS)
