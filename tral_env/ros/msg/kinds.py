"""Kinds of fields that the type checker takes for lists and texts, and Cyclone DDS for arrays and bounded texts."""

from typing import TYPE_CHECKING

from cyclonedds.idl import types

if TYPE_CHECKING:
    from collections.abc import Sequence as Sequence

    Floats9 = list[float]
    Floats12 = list[float]
    Floats36 = list[float]
    Bytes16 = list[int]
    Text256 = str
else:
    Sequence = types.sequence
    Floats9 = types.array[types.float64, 9]
    Floats12 = types.array[types.float64, 12]
    Floats36 = types.array[types.float64, 36]
    Bytes16 = types.array[types.uint8, 16]
    Text256 = types.bounded_str[256]
