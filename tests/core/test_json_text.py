"""JSON that a person wrote: one reader says where it is none, and which keys stand more than once."""

import pytest

from tral_env import json_text
from tral_env.errors import BadFileError


def told(text: str) -> str:
    with pytest.raises(BadFileError) as error:
        json_text.loads(text, "a.json", BadFileError)
    return str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a.json: not JSON: it is empty"),
        ("\ufeff \n", "a.json: not JSON: it is empty"),
        (
            '{\n"a": 0,5}',
            "a.json:2:8: not JSON: Expecting property name enclosed in double quotes: a decimal comma? JSON writes 0.8",
        ),
        (
            "{} {}",
            "a.json:1:4: not JSON: Extra data: two files in one? Appending (>>) to a file does that, replace it (>)",
        ),
        ("[" * 100_000, "a.json: not readable: nested too deeply"),
        ("9" * 10_000, "a.json: not readable: a whole number of thousands of digits"),
    ],
)
def test_what_is_no_json_is_told_with_its_place(text: str, message: str) -> None:
    assert told(text) == message


def test_every_key_that_stands_twice_is_told() -> None:
    assert told('{"a": 1, "b": [{"c": 1, "c": 2}], "a": 3}') == (
        "a.json: 2 problems\n"
        "  /a: is there more than once. Allowed: each key once\n"
        "  /b/0/c: is there more than once. Allowed: each key once"
    )


def test_a_byte_order_mark_is_skipped_and_small_numbers_are_numbers() -> None:
    assert json_text.loads('\ufeff{"a": 1e-05}', "a.json", BadFileError) == {"a": 1e-05}
