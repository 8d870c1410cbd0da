"""Messages against readers that are not ours, both ways: all types, all fields, with the official definitions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from cyclonedds.idl import IdlStruct
from hypothesis import given, settings
from hypothesis import strategies as st
from message_types import ALL, NAMES, official

from tral_env.ros.definition import Field, definition, fields, ros_name, type_hash

STORE = official()
_BITS = {"int32": (32, True), "uint8": (8, False), "byte": (7, False), "uint32": (32, False), "int64": (64, True)}
_BITS |= {"uint64": (64, False)}
# rosbags gives a byte from 128 on as a negative number, so these are left out.
_TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\0", exclude_categories=["Cs"]), max_size=12)


def one(field: Field) -> st.SearchStrategy[Any]:
    if field.nested is not None:
        return messages(field.nested)
    if field.kind == "string":
        return _TEXT
    if field.kind == "bool":
        return st.booleans()
    if field.kind.startswith("float"):
        return st.floats(width=int(field.kind[5:]))  # type: ignore[arg-type]
    bits, signed = _BITS[field.kind]
    return st.integers(-(2 ** (bits - 1)) if signed else 0, 2 ** (bits - signed) - 1)


def values(field: Field) -> st.SearchStrategy[Any]:
    if field.capacity:
        return st.lists(one(field), min_size=field.capacity, max_size=field.capacity)
    return st.lists(one(field), max_size=3) if field.type_id > 144 else one(field)


def messages(kind: type[IdlStruct]) -> st.SearchStrategy[Any]:
    return st.builds(kind, **{field.name: values(field) for field in fields(kind)})


def same(ours: Any, theirs: Any) -> bool:
    if isinstance(ours, IdlStruct):
        return all(same(getattr(ours, f.name), getattr(theirs, f.name)) for f in fields(type(ours)))
    if isinstance(ours, list | tuple | bytes | np.ndarray):
        return len(ours) == len(theirs) and all(map(same, ours, theirs))
    return ours == theirs or (math.isnan(ours) and math.isnan(theirs))


@pytest.mark.parametrize("kind", ALL, ids=NAMES)
def test_others_read_what_we_write_and_we_what_they_write(kind: type[IdlStruct]) -> None:
    @settings(max_examples=5, deadline=None)
    @given(messages(kind))
    def check(message: Any) -> None:
        ours = message.serialize(use_version_2=False)
        theirs = STORE.deserialize_cdr(ours, ros_name(kind))
        assert same(message, theirs)
        assert same(kind.deserialize(bytes(STORE.serialize_cdr(theirs, ros_name(kind)))), theirs)

    check()


@pytest.mark.parametrize("kind", ALL, ids=NAMES)
def test_the_definition_has_the_official_fields_in_their_order(kind: type[IdlStruct]) -> None:
    official_fields = STORE.fielddefs[ros_name(kind)][1]
    assert [field.name for field in fields(kind)] == [name for name, _ in official_fields]


@pytest.mark.parametrize(
    "kind", [kind for kind in ALL if not ros_name(kind).startswith("rmw_dds")], ids=lambda kind: ros_name(kind)
)
def test_the_hash_is_that_of_ros(kind: type[IdlStruct]) -> None:
    assert type_hash(kind) == STORE.hash_rihs01(ros_name(kind))


@pytest.mark.parametrize("kind", ALL, ids=NAMES)
def test_the_definition_as_text_says_the_same_to_others(kind: type[IdlStruct]) -> None:
    from rosbags.typesys import get_types_from_msg

    found = get_types_from_msg(definition(kind), ros_name(kind))
    assert [name for name, _ in found[ros_name(kind)][1]] == [field.name for field in fields(kind)]
    from mcap_ros2._dynamic import generate_dynamic

    assert generate_dynamic(ros_name(kind), definition(kind))
