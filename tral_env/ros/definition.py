"""What ROS 2 knows of a message type beside its bytes: its name, its definition as text, and its hash (REP 2011)."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from typing import Any, NamedTuple, get_args

from cyclonedds.idl import IdlStruct, types
from cyclonedds.idl._type_normalize import get_extended_type_hints

_SCALARS = {
    "int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8, "uint64": 9,
    "float32": 10, "float64": 11, "bool": 15, "byte": 16,
}  # fmt: skip
"""Name -> id of type_description_interfaces/msg/FieldType."""
_NESTED, _STRING, _BOUNDED_STRING = 1, 17, 21
_ARRAY, _SEQUENCE = 48, 144
"""What an array and a sequence without bound add to the id of their items."""


class Field(NamedTuple):
    """A field of a message."""

    name: str
    kind: str
    """Name of the type of the field or of its items, such as float64, string or std_msgs/msg/Header."""
    type_id: int
    capacity: int = 0
    """Length of an array."""
    string_capacity: int = 0
    nested: type[IdlStruct] | None = None


def ros_name(message: type[IdlStruct]) -> str:
    """Name of a type, such as sensor_msgs/msg/Range."""
    parts: list[str] = message.__idl_typename__.split("::")
    return f"{parts[0]}/{parts[1]}/{parts[3].removesuffix('_')}"


@cache
def fields(message: type[IdlStruct]) -> tuple[Field, ...]:
    """The fields of a message in their order."""
    return tuple(_field(name, kind) for name, kind in get_extended_type_hints(message).items())


def definition(message: type[IdlStruct]) -> str:
    """The definition of a type and all that it holds, as rosbag2 and MCAP files hold it (`ros2msg`)."""
    parts = [_text(message)]
    for other in referenced(message):
        name = ros_name(other).replace("/msg/", "/")
        parts.append(f"{'=' * 80}\nMSG: {name}\n{_text(other)}")
    return "".join(parts)


@cache
def type_hash(message: type[IdlStruct]) -> str:
    """The hash by which ROS 2 nodes know that they mean the same type, such as RIHS01_b42b...."""
    described = {
        "type_description": _description(message),
        "referenced_type_descriptions": [_description(other) for other in referenced(message)],
    }
    return "RIHS01_" + hashlib.sha256(json.dumps(described).encode()).hexdigest()


@cache
def referenced(message: type[IdlStruct]) -> tuple[type[IdlStruct], ...]:
    """All types that a type holds, also below, by name."""
    found: dict[str, type[IdlStruct]] = {}
    todo = [message]
    while todo:
        for field in fields(todo.pop()):
            if field.nested is not None and ros_name(field.nested) not in found:
                found[ros_name(field.nested)] = field.nested
                todo.append(field.nested)
    return tuple(found[name] for name in sorted(found))


def _field(name: str, kind: Any) -> Field:
    annotated = get_args(kind)[1] if get_args(kind) else kind
    if isinstance(annotated, types.array):
        item = _field(name, annotated.subtype)
        return item._replace(type_id=item.type_id + _ARRAY, capacity=annotated.length)
    if isinstance(annotated, types.sequence):
        item = _field(name, annotated.subtype)
        return item._replace(type_id=item.type_id + _SEQUENCE)
    if isinstance(annotated, types.bounded_str):
        return Field(name, "string", _BOUNDED_STRING, string_capacity=annotated.max_length)
    if kind is str:
        return Field(name, "string", _STRING)
    if isinstance(kind, type) and issubclass(kind, IdlStruct):
        return Field(name, ros_name(kind), _NESTED, nested=kind)
    scalar = kind.__name__ if isinstance(kind, type) else str(annotated)
    return Field(name, scalar, _SCALARS[scalar])


def _text(message: type[IdlStruct]) -> str:
    return "".join(f"{_spelled(field)} {field.name}\n" for field in fields(message))


def _spelled(field: Field) -> str:
    kind = field.kind.replace("/msg/", "/")
    if field.string_capacity:
        kind += f"<={field.string_capacity}"
    if field.type_id > _SEQUENCE:
        return f"{kind}[]"
    return f"{kind}[{field.capacity}]" if field.capacity else kind


def _description(message: type[IdlStruct]) -> dict[str, Any]:
    return {
        "type_name": ros_name(message),
        "fields": [
            {
                "name": field.name,
                "type": {
                    "type_id": field.type_id,
                    "capacity": field.capacity,
                    "string_capacity": field.string_capacity,
                    "nested_type_name": "" if field.nested is None else field.kind,
                },
            }
            for field in fields(message)
        ],
    }
