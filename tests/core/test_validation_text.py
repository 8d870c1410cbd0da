"""Errors of pydantic in the words of a file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field, StrictInt, StrictStr, ValidationError

from tral_env.validation_text import allowed, choices, members, names, place

Name = StrictInt | Annotated[StrictStr, Field(min_length=1)]


class Box(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    width: Annotated[float, Field(gt=0, le=2.5)] | None = None
    side: Literal["left", "right"] | None = None


class Shelf(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    name: Name = 0
    start: Name = Field(1, alias="from")
    boxes: list[Box] = []
    pair: tuple[float, Box] = (0.0, Box())
    by_word: dict[str, Box] = {}
    code: str = Field("a", pattern="^a")
    count: int = Field(2, multiple_of=2)


def error(**values: Any) -> Any:
    """The first error of a shelf."""
    with pytest.raises(ValidationError) as caught:
        Shelf.model_validate(values)
    return caught.value.errors()[0]


@pytest.mark.parametrize(
    ("values", "steps"),
    [
        ({"name": ""}, ("name",)),  # pydantic names the member of the union that it tried
        ({"from": 1.5}, ("from",)),
        ({"boxes": [{}, {"width": 3.0}]}, ("boxes", 1, "width")),
        ({"pair": (0.0, {"side": "up"})}, ("pair", 1, "side")),
        ({"by_word": {"low": {"width": "1"}}}, ("by_word", "low", "width")),
        ({"boxes": [{"widht": 1.0}]}, ("boxes", 0, "widht")),
    ],
)
def test_a_place_holds_members_and_indices_alone(values: dict[str, Any], steps: tuple[int | str, ...]) -> None:
    assert place(Shelf, error(**values)).steps == steps


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"name": ""}, "a whole number or a word"),
        ({"boxes": [{"width": 0.0}]}, "more than 0"),
        ({"boxes": [{"width": 2.6}]}, "2.5 or less"),
        ({"boxes": [{"width": float("nan")}]}, "a finite number"),
        ({"boxes": [{"width": "1"}]}, "a number"),
        ({"boxes": [3]}, "an object"),
        ({"boxes": 3}, "an array"),
        ({"by_word": 3}, "an object"),
        ({"code": "b"}, "a text that matches ^a"),
        ({"count": 3}, "a multiple of 2"),
    ],
)
def test_what_is_allowed_is_told_by_kind_limits_and_types(values: dict[str, Any], told: str) -> None:
    found = error(**values)
    assert allowed(place(Shelf, found).annotation, found) == told


def test_a_file_may_have_words_of_its_own_and_an_unknown_kind_is_named() -> None:
    assert allowed(float, {"type": "greater_than", "ctx": {"gt": 0.5}}, {"greater_than": "above {gt}"}) == "above 0.5"
    assert allowed(str, {"type": "string_unicode"}) == "another value (string unicode)"


def test_choices_and_names_come_from_the_annotations() -> None:
    found = place(Shelf, error(boxes=[{"side": "up"}]))
    assert choices(found.annotation) == ["left", "right"]
    assert names(found.owner) == ["width", "side"]
    assert names(Shelf)[:2] == ["name", "from"]
    assert members(Name | None) == (int, str)
