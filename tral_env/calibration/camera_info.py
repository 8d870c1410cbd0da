"""Lenses by name and as files: the YAML that ROS calls camera_info, written and read without OpenCV or ROS.

Such a file says nothing of the mounting, the frame rate and the size of markers; these are the defaults of
`CameraConfig`.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from tral_env.atomic import write_bytes
from tral_env.config import WIDE_LENS, CameraConfig, as_config
from tral_env.errors import CalibrationError, ConfigError, nearest

LENSES = {"default": CameraConfig(), "wide": WIDE_LENS}
"""These lenses have a name."""

_SUFFIXES = (".yaml", ".yml")
_MODELS = {"plumb_bob": 5, "radtan": 5, "rational_polynomial": 8}
"""A file may name one of these distortion models, with so many coefficients; beyond the fifth all have to be 0."""
_REQUIRED = ("image_width", "image_height", "camera_matrix", "distortion_model", "distortion_coefficients")
_MAX_PIXELS = 65535
"""An image has at most so many pixels across or down."""
_SHORT = reprlib.Repr()
"""An error tells by this what was got: a few lines of YAML can mean millions of values."""
_SHORT.maxlevel, _SHORT.maxlist, _SHORT.maxstring = 2, 9, 60


def load_lens(source: str | Path | CameraConfig | Mapping[str, Any] | None) -> CameraConfig:
    """Find a lens by its name, by its file, or as it is.

    Args:
        source: "default", "wide", path of a camera_info file (.yaml, .yml), a configuration or a mapping of its values;
            None: the default.

    Raises:
        ConfigError: there is no such name, or the source is none of these.
        CalibrationError: the file cannot be used.
    """
    if isinstance(source, str) and not source.lower().endswith(_SUFFIXES):
        if source not in LENSES:
            raise ConfigError(f"unknown lens '{source}': {nearest(source, LENSES)}; a path has to end in .yaml or .yml")
        return LENSES[source]
    if isinstance(source, str | Path):
        return read_camera_info(source)
    return as_config(CameraConfig, source)


def read_camera_info(path: str | Path) -> CameraConfig:
    """Read a lens from a camera_info file.

    Raises:
        CalibrationError: the file cannot be read, is no YAML, lacks something or has it in the wrong form, or needs
            another model of distortion than plumb_bob.
    """
    try:
        text = Path(path).read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CalibrationError(f"cannot read the lens '{path}': {error}") from error
    return parse_camera_info(text, str(path))


def parse_camera_info(text: str, where: str) -> CameraConfig:
    """Read a lens from the text of a camera_info file.

    Args:
        text: the YAML.
        where: name of the file in error messages.

    Raises:
        CalibrationError: see `read_camera_info`.
    """
    try:
        content = yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{where}:{mark.line + 1}:{mark.column + 1}" if mark else where
        raise CalibrationError(f"{place}: not YAML: {getattr(error, 'problem', None) or error}") from error
    except (
        RecursionError,
        ValueError,
        LookupError,
        AttributeError,
    ) as error:  # the last two: !!bool foo, !!timestamp x
        raise CalibrationError(f"{where}: not readable: {error}") from error
    if not isinstance(content, dict):
        raise CalibrationError(f"{where}: got {type(content).__name__}, expected a mapping with {', '.join(_REQUIRED)}")
    missing = [name for name in _REQUIRED if name not in content]
    if missing:
        raise CalibrationError(f"{where}: {', '.join(missing)} missing. There: {', '.join(map(str, content)) or '-'}")
    matrix = _numbers(content["camera_matrix"], f"{where}: camera_matrix", (9,))
    if any(matrix[i] for i in (1, 3, 6, 7)) or matrix[8] != 1.0:
        raise CalibrationError(f"{where}: camera_matrix {matrix}: expected [fx, 0, cx, 0, fy, cy, 0, 0, 1]")
    try:
        return CameraConfig(
            width=_whole(content["image_width"], f"{where}: image_width"),
            height=_whole(content["image_height"], f"{where}: image_height"),
            fx=matrix[0],
            fy=matrix[4],
            cx=matrix[2],
            cy=matrix[5],
            distortion=_distortion(content, where),
        )
    except ConfigError as error:
        raise CalibrationError(f"{where}: {error}") from error


def _distortion(content: Mapping[str, Any], where: str) -> tuple[float, ...]:
    """Read the coefficients k1, k2, p1, p2, k3."""
    model = content["distortion_model"]
    if not isinstance(model, str) or model not in _MODELS:
        raise CalibrationError(
            f"{where}: distortion_model {_SHORT.repr(model)}: {nearest(_SHORT.repr(model), _MODELS)}"
        )
    values = _numbers(
        content["distortion_coefficients"], f"{where}: distortion_coefficients", (0, 4, 5, _MODELS[model])
    )
    values += [0.0] * (8 - len(values))
    if any(values[5:]):
        raise CalibrationError(
            f"{where}: distortion_coefficients {values}: only k1, k2, p1, p2, k3 can be other than 0; calibrate with "
            "the model plumb_bob"
        )
    return tuple(values[:5])


def _numbers(matrix: Any, where: str, lengths: tuple[int, ...]) -> list[float]:
    """Read the numbers of a matrix that has one of these lengths."""
    data = matrix.get("data") if isinstance(matrix, dict) else None
    if not isinstance(data, list) or len(data) not in lengths:
        allowed = " or ".join(str(length) for length in sorted(set(lengths)))
        raise CalibrationError(f"{where}: got {_SHORT.repr(matrix)}: expected 'data' with {allowed} numbers")
    return [_number(value, f"{where}.data[{i}]") for i, value in enumerate(data)]


def _number(value: Any, where: str) -> float:
    # YAML 1.1 reads 1e-05, which has no point, as text.
    try:
        number = float(value) if not isinstance(value, bool) else math.nan
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise CalibrationError(f"{where} = {_SHORT.repr(value)}: expected a finite number")
    return number


def _whole(value: Any, where: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= _MAX_PIXELS:
        raise CalibrationError(f"{where} = {_SHORT.repr(value)}: expected a whole number of pixels, 1 to {_MAX_PIXELS}")
    return value


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
