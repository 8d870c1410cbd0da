"""A detection counts when images agree on its place."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.interface import CONTROL_PERIOD_S, MAX_AGE_S
from tral_fsm.estimation.detections import NOTHING, Agreement, Detection

IMAGE_S = 1 / 15
PLACES = {"here": (2.0, 0.5), "there": (2.0, -1.5), "far": (4.0, 0.5)}


def supports(*images: tuple[int, str]) -> list[int]:
    """Support of each of these images, id and place, that a camera takes one after the other."""
    agreement = Agreement()
    out = []
    for k, (number, place) in enumerate(images):
        x, y = PLACES[place]
        out.append(agreement.judge(Detection(number, x, y, new=True), k * IMAGE_S, 2.0).support)
    return out


class TestAgreement:
    def test_images_that_agree_add_up(self) -> None:
        assert supports((8, "here"), (8, "here"), (8, "here")) == [1, 2, 3]

    def test_one_that_disagrees_begins_anew(self) -> None:
        assert supports((8, "here"), (8, "here"), (8, "there"), (8, "here"), (8, "here")) == [1, 2, 1, 1, 2]

    def test_another_id_neither_confirms_nor_contradicts(self) -> None:
        assert supports((8, "here"), (9, "here"), (8, "here"), (9, "far")) == [1, 1, 2, 1]

    @given(st.lists(st.tuples(st.sampled_from([8, 9]), st.sampled_from(sorted(PLACES))), max_size=12))
    def test_the_support_of_an_id_is_the_length_of_its_run_at_one_place(self, images: list[tuple[int, str]]) -> None:
        expected = []
        for k, (number, place) in enumerate(images):
            places = [other for of, other in images[: k + 1] if of == number]
            run = 0
            while run < len(places) and places[-1 - run] == place:
                run += 1
            expected.append(run)
        assert supports(*images) == expected

    @pytest.mark.parametrize(("gap_s", "support"), [(0.99, 2), (1.01, 1)])
    def test_an_image_of_long_ago_confirms_nothing(self, gap_s: float, support: int) -> None:
        agreement = Agreement()
        agreement.judge(Detection(8, 2.0, 0.5), 3.0, 2.0)
        assert agreement.judge(Detection(8, 2.0, 0.5), 3.0 + gap_s, 2.0).support == support

    @pytest.mark.parametrize(("range_m", "apart", "support"), [(2, 0.39, 2), (2, 0.41, 1), (6, 0.79, 2), (6, 0.81, 1)])
    def test_far_places_may_differ_more(self, range_m: float, apart: float, support: int) -> None:
        agreement = Agreement()
        agreement.judge(Detection(8, range_m, 0.0), 0.0, range_m)
        assert agreement.judge(Detection(8, range_m, apart), IMAGE_S, range_m).support == support

    def test_it_changes_nothing_but_the_support(self) -> None:
        seen = Detection(8, 2.0, 0.5, 0.1, 0.03, True)
        assert Agreement().judge(seen, 0.0, 2.0) == seen._replace(support=1)


class TestDetection:
    def test_a_tick_later_it_is_older_and_not_new(self) -> None:
        seen = Detection(8, 2.0, 0.5, 0.1, 0.03, True, 0.8, 3)
        assert seen.older() == seen._replace(age=0.03 + CONTROL_PERIOD_S, new=False)

    def test_its_age_ends_where_the_readings_do(self) -> None:
        assert Detection(8, age=MAX_AGE_S - 0.001).older().age == MAX_AGE_S

    def test_nothing_stays_nothing(self) -> None:
        assert NOTHING.older() is NOTHING
