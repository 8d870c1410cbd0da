"""Lenses by name and as files: the YAML that ROS calls camera_info is written, those of other programs are read, too.

Such a file says nothing of the mounting, the frame rate and the size of markers; these are the defaults of
`CameraConfig`.
"""

from __future__ import annotations

import re
import reprlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from tral_env import json_text
from tral_env.atomic import write_bytes
from tral_env.calibration.lens_files import KEYS, lens_documents, named
from tral_env.checks import is_number
from tral_env.config import WIDE_LENS, CameraConfig, as_config
from tral_env.errors import CalibrationError, ConfigError, UnreadableCalibrationError, nearest
from tral_env.yaml_text import Items, Lines, number

LENSES = {"default": CameraConfig(), "wide": WIDE_LENS}
"""These lenses have a name."""

_SUFFIXES = (".yaml", ".yml", ".xml", ".ini")
_ENDS = f"{', '.join(_SUFFIXES[:-1])} or {_SUFFIXES[-1]}"
_MODELS = ("plumb_bob", "radtan", "rational_polynomial", "none")
"""A file may name one of these distortion models, or not name any; all coefficients beyond the fifth have to be 0."""
_FISHEYE = ("equidistant", "fisheye", "kannala_brandt", "kannala_brandt4", "equi")
"""Distortion models of lenses that this package cannot simulate have these names."""
_COUNTS = (0, 4, 5, 8, 12, 14)
"""OpenCV writes so many coefficients."""
_ADD = {
    "image_width": "image_width: 640",
    "image_height": "image_height: 480",
    "camera_matrix": "camera_matrix: {data: [fx, 0, cx, 0, fy, cy, 0, 0, 1]}",
    "distortion_coefficients": "distortion_coefficients: {data: [k1, k2, p1, p2, k3]}",
}
"""These lines can be added to a file that lacks the key."""
_REMEDY = "calibrate with this package's model, by `tral calibrate`, and with 3 radial terms"
_MAX_PIXELS = 65535
"""An image has at most so many pixels across or down."""
_MAX_LENGTH = 100
"""A list with more items is not looked at."""
_SHORT = reprlib.Repr()
"""An error tells by this what was got: a few lines of YAML can mean millions of values."""
_SHORT.maxlevel, _SHORT.maxlist, _SHORT.maxstring = 2, 9, 60


def load_lens(source: str | Path | CameraConfig | Mapping[str, Any] | None) -> CameraConfig:
    """Find a lens by its name, by its file, or as it is.

    Args:
        source: "default", "wide", path of a lens file (.yaml, .yml, .xml, .ini), a configuration or a mapping of its
            values;
            None: the default.

    Raises:
        ConfigError: there is no such name, or the source is none of these.
        CalibrationError: the file cannot be used.
    """
    if isinstance(source, str) and not source.lower().endswith(_SUFFIXES):
        if source not in LENSES:
            raise ConfigError(f"unknown lens '{source}': {nearest(source, LENSES)}; a path has to end in {_ENDS}")
        return LENSES[source]
    if isinstance(source, str | Path):
        return read_camera_info(source)
    return as_config(CameraConfig, source)


def read_camera_info(path: str | Path) -> CameraConfig:
    """Read a lens from a camera_info file, or from a file of OpenCV, Kalibr, ROS 1 or `ros2 topic echo`.

    Raises:
        UnreadableCalibrationError: the file cannot be opened.
        CalibrationError: it is no text, is in no such format, lacks something or has it in the wrong form, or
            needs another model of distortion than plumb_bob.
    """
    try:
        text = json_text.read(path)
    except (OSError, ValueError) as error:  # a name with a null is a ValueError
        told = f"cannot read the lens {str(path)!r}: {json_text.unread(error)}"
        if isinstance(error, UnicodeDecodeError):
            raise CalibrationError(told) from error
        raise UnreadableCalibrationError(told) from error
    return parse_camera_info(text, str(path))


def parse_camera_info(text: str, where: str) -> CameraConfig:
    """Read a lens from the text of such a file; see `read_camera_info`.

    Args:
        text: the file; if it holds several lenses, as a stream of messages does, they have to be the same.
        where: name of the file in error messages.

    Raises:
        CalibrationError: see `read_camera_info`.
    """
    lenses = [_lens(content, where) for content in lens_documents(text, where) or [None]]
    if lenses.count(lenses[0]) < len(lenses):
        raise CalibrationError(f"{where}: {len(lenses)} lenses between lines of '---' that differ: keep one of them")
    return lenses[0]


@dataclass(frozen=True)
class _Entry:
    """A value of a file, and its place there."""

    value: Any
    where: str
    """File, line and key."""
    file: str

    def item(self, index: int) -> str:
        """Place of an item of this list: file, line and key."""
        key = self.where.rpartition(": ")[2]
        line = f":{self.value.lines[index]}" if isinstance(self.value, Items) and index < len(self.value.lines) else ""
        return f"{self.file}{line}: {key}[{index}]" if line else f"{self.where}[{index}]"


def _lens(content: Any, where: str) -> CameraConfig:
    """Read a lens from a document."""
    if not isinstance(content, Lines):
        got = "nothing" if content is None else type(content).__name__.lower()
        raise CalibrationError(f"{where}: got {got}, expected a mapping with {', '.join(KEYS)}")
    model = _known_model(content, where)
    found = {name: _find(content, name, where) for name in KEYS}
    if model == "none" and found["distortion_coefficients"] is None:
        found["distortion_coefficients"] = _Entry(None, where, where)
    missing = [name for name, entry in found.items() if entry is None]
    if missing:
        there = ", ".join(str(key)[:40] for key in list(content)[:20]) or "-"
        raise CalibrationError(
            f"{where}: {', '.join(missing)} missing. There: {there}. Add a line such as '{_ADD[missing[0]]}'"
        )
    width, height, matrix, coefficients = (entry for entry in found.values() if entry)
    _require_whole_image(content, where)
    fx, fy, cx, cy = _pinhole(matrix)
    distortion = _distortion(coefficients, model)
    try:
        return CameraConfig(
            width=_whole(width), height=_whole(height), fx=fx, fy=fy, cx=cx, cy=cy, distortion=distortion
        )
    except ConfigError as error:
        raise CalibrationError(f"{where}: {error}") from error


def _find(content: Lines, name: str, where: str) -> _Entry | None:
    """The entry that has one of the names of a key; None: there is none.

    Raises:
        CalibrationError: two keys have one meaning.
    """
    keys = named(content, name)
    if len(keys) > 1:
        lines = [f"'{key}' in line {content.lines[key]}" for key in keys]
        raise CalibrationError(f"{where}: {' and '.join(lines)} both mean {name}: delete one of them")
    return _Entry(content[keys[0]], f"{where}:{content.lines[keys[0]]}: {keys[0]}", where) if keys else None


def _distortion(coefficients: _Entry, model: str) -> tuple[float, ...]:
    """Read the coefficients k1, k2, p1, p2, k3."""
    values = _numbers(coefficients, _COUNTS)
    if model == "none" and any(values):
        raise CalibrationError(f"{coefficients.where} {_SHORT.repr(values)}: but the distortion model is 'none'")
    if any(values[5:]):
        raise CalibrationError(
            f"{coefficients.where} {_SHORT.repr(values)}: only k1, k2, p1, p2, k3 can be other than 0; {_REMEDY}"
        )
    return tuple((values + [0.0] * 5)[:5])


def _known_model(content: Lines, where: str) -> str:
    """The name of the model of distortion, empty if the file names none; ROS says distortion_model, some programs
    camera_model, OpenCV fisheye_model: 1."""
    known = ""
    for key in ("distortion_model", "camera_model", "fisheye_model"):
        if content.get(key) in (None, "", 0):
            continue
        model, place = content[key], f"{where}:{content.lines[key]}: {key}"
        name = model.strip().lower().replace("-", "_") if isinstance(model, str) else None
        if name in _FISHEYE or key == "fisheye_model":
            raise CalibrationError(
                f"{place} {_SHORT.repr(model)}: a fisheye lens, which this package cannot simulate. For a lens of at "
                f"most 120 degrees, {_REMEDY}"
            )
        if (key, name) == ("camera_model", "pinhole"):
            continue
        if name not in _MODELS:
            allowed = _MODELS if key == "distortion_model" else ("pinhole", *_MODELS)
            raise CalibrationError(
                f"{place} {_SHORT.repr(model)}: {nearest(_SHORT.repr(model), allowed)}; for a lens of another model, "
                f"{_REMEDY}"
            )
        known = known or name
    return known


def _require_whole_image(content: Lines, where: str) -> None:
    """Check that a message of ROS describes the image as a whole: no binning, no region of interest."""
    binned = [key for key in ("binning_x", "binning_y") if content.get(key) not in (None, 0, 1)]
    region = content.get("roi")
    cut = isinstance(region, dict) and any(region.get(key) for key in ("x_offset", "y_offset"))
    for key in (*binned, *(["roi"] if cut else [])):
        raise CalibrationError(
            f"{where}:{content.lines[key]}: {key} = {_SHORT.repr(content[key])}: the lens is that of another image; "
            "let the camera give whole images, unbinned"
        )


def _pinhole(matrix: _Entry) -> tuple[float, float, float, float]:
    """Read fx, fy, cx, cy."""
    values = _numbers(matrix, (9,))
    if not any(values):
        raise CalibrationError(f"{matrix.where} is 0: the camera is not calibrated. Run `tral calibrate`")
    if any(values[i] for i in (1, 3, 6, 7)) or values[8] != 1.0:
        raise CalibrationError(f"{matrix.where} {_SHORT.repr(values)}: expected [fx, 0, cx, 0, fy, cy, 0, 0, 1]")
    return values[0], values[4], values[2], values[5]


def _numbers(entry: _Entry, lengths: tuple[int, ...]) -> list[float]:
    """Read the numbers of a matrix that has one of these lengths: a list, one list a row, or 'data' with either."""
    whole, where = entry.value, entry.where
    if isinstance(whole, Lines) and "data" in whole:
        place = f"{entry.file}:{whole.lines['data']}: {where.rpartition(': ')[2]}.data"
        entry = _Entry(whole["data"], place, entry.file)
    found = _flat(entry)
    if found is None or len(found) not in lengths:
        allowed = " or ".join(", ".join(map(str, lengths)).rsplit(", ", 1))
        count = "" if found is None else f", {len(found)} numbers"
        raise CalibrationError(f"{where}: got {_SHORT.repr(whole)}{count}: expected {allowed} numbers")
    return [_number(value, place) for value, place in found]


def _flat(entry: _Entry) -> list[tuple[Any, str]] | None:
    """Each number with its place; spaces part numbers as commas do; None: this is no list, or a very long one."""
    value = entry.value
    if value is None:
        return []
    if isinstance(value, str):
        parts = re.split(r"[,;\s]+", value.strip("[]() \n"))
        return [(part, f"{entry.where}[{i}]") for i, part in enumerate(parts) if part]
    if not isinstance(value, Items) or len(value) > _MAX_LENGTH:
        return None
    found: list[tuple[Any, str]] = []
    for index, item in enumerate(value):
        part = _Entry(item, entry.item(index), entry.file)
        nested = isinstance(item, Items) or (isinstance(item, str) and len(item.split()) > 1)
        more = _flat(part) if nested else [(item, part.where)]
        if more is None or len(found) + len(more) > _MAX_LENGTH:
            return None
        found += more
    return found


def _number(value: Any, where: str) -> float:
    found = number(value)
    if not is_number(found):
        hint = ""
        if isinstance(value, str) and re.fullmatch(r"-?\d+,\d+", value):
            hint = "; a point parts the decimals"
        raise CalibrationError(f"{where} = {_SHORT.repr(value)}: expected a finite number{hint}")
    return float(found)


def _whole(entry: _Entry) -> int:
    value = number(entry.value)
    if not is_number(value) or not 1 <= value <= _MAX_PIXELS or value != int(value):
        raise CalibrationError(
            f"{entry.where} = {_SHORT.repr(entry.value)}: expected a whole number of pixels, 1 to {_MAX_PIXELS}"
        )
    return int(value)


def camera_info(camera: CameraConfig, name: str = "camera") -> str:
    """Write the text of a camera_info file, which gives the same lens to the last bit when it is read again.

    Args:
        camera: the lens.
        name: name of the camera.
    """
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    content = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": name,
        "camera_matrix": _matrix(3, 3, [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        "distortion_model": "plumb_bob",
        "distortion_coefficients": _matrix(1, 5, list(camera.distortion)),
        "rectification_matrix": _matrix(3, 3, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        "projection_matrix": _matrix(3, 4, [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
    }
    return str(yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120))


def _matrix(rows: int, columns: int, values: list[float]) -> dict[str, Any]:
    return {"rows": rows, "cols": columns, "data": [float(value) for value in values]}


def write_camera_info(path: Path, camera: CameraConfig, name: str = "camera") -> None:
    """Write a camera_info file as a whole: if that fails, the old file is still there; a link stays one.

    Args:
        path: the file.
        camera: the lens.
        name: name of the camera.

    Raises:
        ConfigError: the file cannot be written.
    """
    try:
        write_bytes(path, camera_info(camera, name).encode("utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}") from error
