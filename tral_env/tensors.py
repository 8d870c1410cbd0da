"""Arrays in a file that holds no code: the safetensors format, as far as policies need it (float32).

A file is the length of its header (8 bytes, little endian), the header (JSON: name -> dtype, shape, place), and the
numbers. Source: https://huggingface.co/docs/safetensors, "Format".
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env import json_text
from tral_env.errors import PolicyFileError

Values = NDArray[np.float32]

MAX_BYTES = 64 * 2**20
"""A file has this size at most."""
MAX_HEADER_BYTES = 2**20
"""A header has this size at most."""


def dumps(tensors: Mapping[str, NDArray[np.floating]]) -> bytes:
    """The content of a file with these arrays, as float32."""
    header: dict[str, Any] = {}
    parts: list[bytes] = []
    at = 0
    for name, values in tensors.items():
        part = np.ascontiguousarray(values, "<f4").tobytes()
        header[name] = {"dtype": "F32", "shape": list(np.shape(values)), "data_offsets": [at, at + len(part)]}
        parts.append(part)
        at += len(part)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    return b"".join([struct.pack("<Q", len(text)), text, *parts])


def loads(content: bytes, source: str) -> dict[str, Values]:
    """The arrays of a file, name -> float32.

    Args:
        content: all of the file.
        source: name of the file, for errors.

    Raises:
        PolicyFileError: the content is no such file, too large, or a number is not finite.
    """
    if len(content) > MAX_BYTES:
        raise PolicyFileError(f"{source}: {len(content)} bytes: expected {MAX_BYTES} at most")
    header, data = _header(content, source)
    tensors, expected = {}, 0
    for name, entry in sorted(header.items(), key=lambda item: _begin(item[1])):
        shape, begin, end = _place(name, entry, source)
        if begin != expected or end > len(data) or end - begin != 4 * math.prod(shape):
            raise PolicyFileError(
                f"{source}: tensor '{name[:40]}' of shape {shape} lies at {begin} to {end} of {len(data)} bytes: "
                f"expected {expected} to {expected + 4 * math.prod(shape)}"
            )
        values = np.frombuffer(data, "<f4", math.prod(shape), begin).astype(np.float32).reshape(shape)
        if not np.isfinite(values).all():
            raise PolicyFileError(f"{source}: tensor '{name[:40]}' has numbers that are not finite")
        tensors[name], expected = values, end
    if expected != len(data):
        raise PolicyFileError(f"{source}: {len(data) - expected} bytes behind the last tensor: is it whole?")
    return tensors


def _header(content: bytes, source: str) -> tuple[dict[str, Any], memoryview]:
    length = struct.unpack("<Q", content[:8])[0] if len(content) >= 8 else 0
    if not 2 <= length <= min(MAX_HEADER_BYTES, len(content) - 8):
        raise PolicyFileError(f"{source}: no safetensors file: its header would have {length} of {len(content)} bytes")
    where = f"{source}: header"
    try:
        text = content[8 : 8 + length].decode("utf-8")
    except UnicodeDecodeError as error:
        raise PolicyFileError(f"{where}: not UTF-8 text: {error.reason} at byte {error.start}") from error
    header = json_text.loads(text, where, PolicyFileError)
    if not isinstance(header, dict):
        raise PolicyFileError(f"{source}: no safetensors file: its header is no JSON object")
    header.pop("__metadata__", None)
    return header, memoryview(content)[8 + length :]


def _begin(entry: Any) -> int:
    offsets = entry.get("data_offsets") if isinstance(entry, dict) else None
    return offsets[0] if isinstance(offsets, list) and offsets and isinstance(offsets[0], int) else -1


def _place(name: str, entry: Any, source: str) -> tuple[list[int], int, int]:
    """Shape, begin and end of a tensor."""
    keys = {"dtype", "shape", "data_offsets"}
    if not isinstance(entry, dict) or entry.keys() != keys or entry["dtype"] != "F32":
        raise PolicyFileError(f"{source}: tensor '{name[:40]}': expected dtype F32, shape and data_offsets")
    shape, offsets = entry["shape"], entry["data_offsets"]
    if not _are_sizes(shape) or not _are_sizes(offsets) or len(offsets) != 2 or len(shape) > 8:
        raise PolicyFileError(f"{source}: tensor '{name[:40]}': its shape or data_offsets are no sizes")
    return shape, offsets[0], offsets[1]


def _are_sizes(values: Any) -> bool:
    """Whether values are whole numbers that a file of `MAX_BYTES` can have."""
    return isinstance(values, list) and all(type(value) is int and 0 <= value <= MAX_BYTES for value in values)
