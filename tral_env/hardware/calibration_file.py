"""Calibration files: found by name or path, read, and refused with all their problems at once."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from tral_env import json_text
from tral_env.errors import CalibrationError, nearest, problem_list
from tral_env.hardware.pulses import CarCalibration, SteeringCalibration, ThrottleCalibration

_FOLDER = resources.files("tral_env.hardware") / "calibrations"
_SUFFIX = ".json"
_SCHEMA = "car.schema.json"
_SECTIONS: Mapping[str, type[BaseModel]] = {"steering": SteeringCalibration, "throttle": ThrottleCalibration}


def packaged_calibrations() -> tuple[str, ...]:
    """Names of the calibrations that come with the package."""
    files = (entry.name for entry in _FOLDER.iterdir())
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in files if name.endswith(_SUFFIX) and name != _SCHEMA))


def json_schema() -> dict[str, Any]:
    """JSON Schema of a calibration file."""
    return CarCalibration.model_json_schema() | {"$schema": "https://json-schema.org/draft/2020-12/schema"}


def load_calibration(source: str | Path | CarCalibration) -> CarCalibration:
    """Read a calibration.

    Args:
        source: name of a packaged one (``"tt01"``), path of a JSON file, or a calibration, which is given back.

    Raises:
        CalibrationError: the file cannot be read, is no JSON or no calibration; the message lists every problem with
            its place.
    """
    if isinstance(source, CarCalibration):
        return source
    if isinstance(source, str) and not source.endswith(_SUFFIX):
        if source not in packaged_calibrations():
            raise CalibrationError(
                f"no packaged calibration '{source}': {nearest(source, packaged_calibrations())}; "
                f"a path has to end in {_SUFFIX}"
            )
        return parse_calibration((_FOLDER / f"{source}{_SUFFIX}").read_text("utf-8"), source)
    try:
        text = json_text.read(source)
    except (OSError, UnicodeDecodeError) as error:
        raise CalibrationError(f"cannot read the calibration '{source}': {error}") from error
    return parse_calibration(text, str(source))


def parse_calibration(text: str, where: str) -> CarCalibration:
    """Read a calibration from JSON text.

    Args:
        text: JSON.
        where: name of the file in error messages.

    Raises:
        CalibrationError: see `load_calibration`.
    """
    text = text.removeprefix("\ufeff")
    try:
        repeated = json_text.repeated_keys(text)
        if not repeated:
            return CarCalibration.model_validate_json(text)
    except json.JSONDecodeError as error:
        told = f"{error.msg}{json_text.reason(error)}"
        raise CalibrationError(f"{where}:{error.lineno}:{error.colno}: not JSON: {told}") from error
    except RecursionError as error:
        raise CalibrationError(f"{where}: nested too deeply") from error
    except ValidationError as error:
        problems = [problem for detail in error.errors() for problem in _problems(detail)]
        raise _report(where, problems) from error
    except ValueError as error:  # an integer of thousands of digits
        raise CalibrationError(f"{where}: not readable: {error}") from error
    raise _report(where, [f"{pointer[1:].replace('/', '.')}: is there twice" for pointer in repeated])


def calibration_problems(error: ValidationError) -> list[tuple[tuple[str, ...], str]]:
    """Each problem of a calibration: the way to its value, and what is wrong there."""
    return [
        (tuple(str(part) for part in detail["loc"]), problem)
        for detail in error.errors()
        for problem in _problems(detail)
    ]


def _report(where: str, problems: list[str]) -> CalibrationError:
    return CalibrationError(
        problem_list(f"calibration '{where}' cannot be used, {len(problems)} problem(s):", problems)
    )


def _problems(detail: Any) -> Iterable[str]:
    """Word an error of pydantic, a line for each problem."""
    place = ".".join(str(part) for part in detail["loc"]) or "file"
    if detail["type"] == "extra_forbidden":
        *path, name = detail["loc"]
        section = _SECTIONS[str(path[0])] if path else CarCalibration
        return [f"{place}: unknown; {nearest(name, section.model_fields)}"]
    if detail["type"] == "value_error":
        return [f"{place}: {line}" for line in str(detail["ctx"]["error"]).splitlines()]
    if detail["type"] == "missing":
        return [f"{place}: is missing"]
    return [f"{place}: got {detail['input']!r}: {detail['msg']}"]
