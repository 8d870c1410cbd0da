"""Lens files of other programs, read into the mapping of a camera_info file: Kalibr, OpenCV's XML, ROS 1's .ini."""

from __future__ import annotations

import re
from typing import Any
from xml.parsers import expat

from tral_env.errors import CalibrationError
from tral_env.yaml_text import Items, Lines, documents, number

_INI = re.compile(r"^\[[^\]\n,]*\]\s*$\s*^(width|height|camera matrix|distortion|externals)\s*$", re.MULTILINE)
"""The parser of ROS 1's camera_calibration_parsers writes such a section and key."""

_XML = re.compile(r"\s*<[?!A-Za-z]")
"""XML begins so; YAML may begin with the merge key `<<`."""
_MAX_DEPTH = 8
"""Elements of an XML lie within each other so deep at most; a lens needs three."""
KEYS = {
    "image_width": ("imagewidth", "width"),
    "image_height": ("imageheight", "height"),
    "camera_matrix": ("cameramatrix", "k", "intrinsicmatrix", "mtx"),
    "distortion_coefficients": ("distortioncoefficients", "distcoeffs", "distortioncoeffs", "dist", "d", "distortion"),
}
"""Programs write each of these keys in several ways; capitals and underscores make no difference."""


def named(content: Lines, name: str) -> list[Any]:
    """The keys of a file that mean one of `KEYS`."""
    return [key for key in content if re.sub(r"[_\- ]", "", str(key)).lower() in KEYS[name]]


def lens_documents(text: str, where: str) -> list[Any]:
    """All documents of a lens file, each with the keys of a camera_info file, and the lines in which they stand.

    Args:
        text: of the file.
        where: name of the file in error messages.

    Raises:
        CalibrationError: the text cannot be parsed; the message names the line.
    """
    if _XML.match(text):
        return [_from_xml(text, where)]
    if _INI.search(text):
        return [_from_ini(text, where)]
    return [_from_kalibr(content, where) for content in documents(text, where, CalibrationError)]


def _from_kalibr(content: Any, where: str) -> Any:
    """A camchain of Kalibr: `cam0` with intrinsics fu, fv, pu, pv and a resolution; another mapping stays as it is.

    A key of Kalibr counts where the file lacks what it would tell: other programs use the same words for other things.
    """
    if not isinstance(content, Lines):
        return content
    cameras = [key for key in content if re.fullmatch(r"cam\d+", str(key)) and isinstance(content[key], Lines)]
    if len(cameras) > 1:
        raise CalibrationError(f"{where}: {len(cameras)} cameras, {', '.join(cameras)}: keep one of them")
    if cameras:
        beside = [str(key) for name in KEYS for key in named(content, name)]
        if beside:
            raise CalibrationError(f"{where}: {cameras[0]} and {', '.join(beside)} both tell a lens: keep one of them")
        content = content[cameras[0]]
    if "intrinsics" in content and not named(content, "camera_matrix") and _is_pinhole(content):
        fx, fy, cx, cy = _items(content, "intrinsics", 4, "fu, fv, pu, pv", where)
        matrix = _listed([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], content.lines["intrinsics"])
        _put(content, "intrinsic_matrix", matrix, content.lines["intrinsics"])
    if "resolution" in content and not (named(content, "image_width") or named(content, "image_height")):
        width, height = _items(content, "resolution", 2, "width, height", where)
        _put(content, "image_width", width, content.lines["resolution"])
        _put(content, "image_height", height, content.lines["resolution"])
    return content


def _is_pinhole(content: Lines) -> bool:
    """Whether the intrinsics are those of a pinhole, as far as the file says; those of others are other numbers."""
    return content.get("camera_model") in (None, "", "pinhole")


def _items(content: Lines, key: str, count: int, names: str, where: str) -> list[Any]:
    found = content[key]
    if not isinstance(found, Items) or len(found) != count:
        raise CalibrationError(f"{where}:{content.lines[key]}: {key}: expected [{names}]")
    return found


def _listed(values: list[Any], line: int) -> Items:
    found = Items(values)
    found.lines = [line] * len(values)
    return found


def _put(content: Lines, key: str, value: Any, line: int) -> None:
    content[key], content.lines[key] = value, line


def _mapping() -> Lines:
    found = Lines()
    found.lines = {}
    return found


def _put_once(content: Lines, key: str, value: Any, line: int, where: str) -> None:
    if key in content:
        raise CalibrationError(
            f"{where}:{line}: '{key}' stands twice, first in line {content.lines[key]}: delete one of them"
        )
    _put(content, key, value, line)


def _plain(text: str) -> Any:
    """What a text of XML or .ini means: a whole number, a decimal one, or the text, which OpenCV may have quoted."""
    text = text.strip()
    if re.fullmatch(r"[+-]?\d{1,18}", text):
        return int(text)
    quoted = re.fullmatch(r'"([^"]*)"', text)
    return quoted[1] if quoted else number(text)


def _from_ini(text: str, where: str) -> Lines:
    """The file of ROS 1's camera_calibration: a key alone on its line, its numbers on the lines below."""
    content, values = _mapping(), Items()
    for line_number, line in enumerate(text.splitlines(), 1):
        told = line.split("#")[0].split(";")[0].strip()
        if not told or told.startswith("["):
            continue
        if told[0].isalpha() and told.lower() not in ("nan", "inf"):
            values = _listed([], line_number)
            _put_once(content, told, values, line_number, where)
        elif not content:
            raise CalibrationError(f"{where}:{line_number}: '{told[:40]}' before any key such as 'width'")
        else:
            parts = told.split()
            values.extend(_plain(part) for part in parts)
            values.lines += [line_number] * len(parts)
    for key in ("width", "height"):
        if key in content and len(content[key]) == 1:
            content[key] = content[key][0]
    return content


class _Storage:
    """Builds the mapping of OpenCV's XML, element by element."""

    def __init__(self, text: str, where: str) -> None:
        self._where = where
        self._open: list[tuple[str, Lines, int]] = []
        self._text = ""
        self.content = _mapping()
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters
        self._parser.EntityDeclHandler = self._refuse
        try:
            self._parser.Parse(text.encode("utf-8"), True)
        except UnicodeEncodeError as error:  # half of a pair of surrogates
            raise CalibrationError(f"{where}: not XML: {error}") from error
        except expat.ExpatError as error:
            told = expat.errors.messages[error.code]
            raise CalibrationError(f"{where}:{error.lineno}:{error.offset + 1}: not XML: {told}") from error

    def _refuse(self, *_: Any) -> None:
        raise CalibrationError(f"{self._where}:{self._parser.CurrentLineNumber}: entities are not read")

    def _start(self, name: str, _: dict[str, str]) -> None:
        if not self._open and name != "opencv_storage":
            raise CalibrationError(f"{self._where}: got XML with <{name}>, expected OpenCV's <opencv_storage>")
        if len(self._open) >= _MAX_DEPTH:
            line = self._parser.CurrentLineNumber
            raise CalibrationError(f"{self._where}:{line}: <{name}> lies within {_MAX_DEPTH} others: no lens file does")
        self._open.append((name, _mapping(), self._parser.CurrentLineNumber))
        self._text = ""

    def _characters(self, text: str) -> None:
        self._text += text

    def _end(self, _: str) -> None:
        name, inner, line = self._open.pop()
        if not self._open:
            self.content = inner
        elif name != "_":  # an item of a sequence, which no lens needs
            _put_once(self._open[-1][1], name, inner or _plain(self._text), line, self._where)
        self._text = ""


def _from_xml(text: str, where: str) -> Lines:
    """The mapping of an XML file that OpenCV's FileStorage wrote."""
    text = re.sub(r"\A\s*<\?xml[^>]*\?>", "", text.lstrip())  # it was decoded already, whatever it says
    return _Storage(text, where).content
