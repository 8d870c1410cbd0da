"""Calibration boards: what is printed on them, and their corners in an image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array, Image
from tral_env.checks import is_number, one_of
from tral_env.errors import ConfigError
from tral_env.perception.dictionaries import dictionary, dictionary_name, marker_count, marker_modules

Kind = Literal["charuco", "chessboard"]

DICTIONARY = "DICT_5X5_50"
"""The markers of a board come from this dictionary: not that of the gates, so that no board is taken for a gate."""
DEFAULT_SIZES: dict[Kind, tuple[int, int, float]] = {"charuco": (7, 5, 36.0), "chessboard": (10, 7, 25.0)}
"""Each board has so many columns and rows, and squares of this edge, mm, by default: it fills a page of A4."""
SEARCH_PX = 1280
"""Larger images are searched for a chessboard in a copy so wide or high: 12 megapixels take 0.6 s instead of 11 s."""
_LENGTHS = (1e-4, 100.0)
"""An edge is at least and at most this long, m: OpenCV counts in single precision."""


@dataclass(frozen=True, kw_only=True)
class Board:
    """A flat board of squares; its frame has its origin in the upper left corner, x right, y down, z into the board."""

    kind: Kind = "charuco"
    """"charuco": markers in the white squares tell the corners apart, so a part of the board is enough; "chessboard":
    squares only, seen as a whole or not at all."""
    columns: int = 7
    """Squares in a row."""
    rows: int = 5
    """Squares in a column."""
    square: float = 0.036
    """Edge of a square, m."""
    marker: float = 0.028
    """Edge of a marker's black square, m; only on a "charuco" board."""
    dictionary: str = DICTIONARY
    """Its markers come from this dictionary of OpenCV; only on a "charuco" board."""
    legacy: bool = False
    """Whether the upper left square is white on a "charuco" board with an even number of rows, as OpenCV before 4.6
    drew it; many boards that are sold are such."""

    def __post_init__(self) -> None:
        one_of("board", self.kind, get_args(Kind))
        for name in ("columns", "rows"):
            value = getattr(self, name)
            if not is_number(value, whole=True) or value < 3:
                raise ConfigError(f"Board.{name} = {value!r}: expected a whole number of 3 or more squares")
            object.__setattr__(self, name, int(value))
        for name in ("square", "marker"):
            value = getattr(self, name)
            if not is_number(value) or not _LENGTHS[0] <= value <= _LENGTHS[1]:
                raise ConfigError(
                    f"Board.{name} = {value!r}: expected a length of {_LENGTHS[0]:g} to {_LENGTHS[1]:g}, in m"
                )
        if self.kind == "charuco":
            self._check_markers()

    def _check_markers(self) -> None:
        if not self.marker < self.square:
            raise ConfigError(f"Board.marker = {self.marker:g}: expected less than the square's {self.square:g} m")
        object.__setattr__(self, "dictionary", dictionary_name(self.dictionary))
        needed, there = self.columns * self.rows // 2, marker_count(self.dictionary)
        if needed > there:
            raise ConfigError(
                f"a charuco board of {self.columns} x {self.rows} squares needs {needed} markers, and there are "
                f"{there} in {self.dictionary}: at most {2 * there + 1} squares, or a larger dictionary"
            )

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the squares all together, m."""
        return self.columns * self.square, self.rows * self.square

    @cached_property
    def corners(self) -> Array:
        """Inner corners, row by row, (k, 3) m; a corner's index is its id."""
        y, x = np.mgrid[1 : self.rows, 1 : self.columns] * self.square
        return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)

    @cached_property
    def black(self) -> Array:
        """What is black, as rectangles x, y, width, height that do not overlap, (r, 4) m."""
        y, x = np.mgrid[: self.rows, : self.columns]
        dark = (x + y) % 2 == (self.kind == "charuco" and self.legacy and self.rows % 2 == 0)
        squares = [
            (i * self.square, j * self.square, self.square, self.square) for i, j in zip(x[dark], y[dark], strict=True)
        ]
        if self.kind == "chessboard":
            return np.array(squares)
        inset = (self.square - self.marker) / 2
        inked = [np.array(squares)]
        for marker, (i, j) in enumerate(zip(x[~dark], y[~dark], strict=True)):
            place = np.array([i * self.square + inset, j * self.square + inset, 0.0, 0.0])
            inked.append(place + marker_ink(self.dictionary, marker) * self.marker)
        return np.concatenate(inked)

    def image(self, pixels_per_metre: float, margin: float = 0.0) -> Image:
        """Draw the board as seen straight on, (h, w) uint8; a pixel that is partly black is grey by that share.

        Args:
            pixels_per_metre: resolution, px/m.
            margin: width of the white around the board, m.
        """
        width, height = (round((length + 2 * margin) * pixels_per_metre) for length in self.size)
        ink = np.zeros((height, width))
        for x, y, w, h in (self.black + np.array([margin, margin, 0.0, 0.0])) * pixels_per_metre:
            (rows, down), (columns, across) = _share(y, y + h, height), _share(x, x + w, width)
            ink[rows, columns] += np.outer(down, across)
        return np.rint(255 * (1 - np.clip(ink, 0, 1))).astype(np.uint8)

    def find(self, image: Image) -> tuple[NDArray[np.int64], Array]:
        """Find the board's corners in an image.

        Args:
            image: (h, w) grey, uint8.

        Returns:
            ids (k,) and pixels (k, 2); k = 0 where no board is seen.
        """
        found, ids = self._find_charuco(image) if self.kind == "charuco" else self._find_chessboard(image)
        if found is None or ids is None or not len(ids):
            return np.zeros(0, np.int64), np.zeros((0, 2))
        return np.ravel(ids).astype(np.int64), np.asarray(found, np.float64).reshape(-1, 2)

    def _find_charuco(self, image: Image) -> tuple[Any, Any]:
        found, ids, _, _ = _charuco_detector(self).detectBoard(image)
        return found, ids

    def _find_chessboard(self, image: Image) -> tuple[Any, Any]:
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
        small, scale = search_copy(image)
        whole, found = cv2.findChessboardCornersSB(small, (self.columns - 1, self.rows - 1), flags=flags)
        if not whole:
            return None, None
        found = np.asarray((np.reshape(found, (-1, 2)) + 0.5) * scale - 0.5, np.float32)
        found = self._refined(image, found)
        ids = np.arange(len(self.corners))
        return found, ids if self._starts_black(image, found) else ids[::-1]

    def _refined(self, image: Image, found: NDArray[Any]) -> Array:
        """Move corners, (k, 2) px, to where the edges cross.

        As OpenCV finds them they make focal lengths 0.2 % too long, which is six times their standard deviation.
        """
        side = float(np.linalg.norm(np.diff(found.reshape(self.rows - 1, -1, 2), axis=1), axis=2).min())
        reach = max(2, min(int(side / 3), 8))
        until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 0.001)
        return np.asarray(cv2.cornerSubPix(image, found, (reach, reach), (-1, -1), until), np.float64)

    def _starts_black(self, image: Image, found: Array) -> bool:
        """Whether the square above and left of the first corner is the black one; else the board was read backwards."""
        across, down = (found[1] - found[0]) / 2, (found[self.columns - 1] - found[0]) / 2
        height, width = image.shape
        middles = np.rint([found[0] - across - down, found[0] + across - down]).astype(int)
        black, white = np.clip(middles, 0, [width - 1, height - 1])
        return bool(image[black[1], black[0]] < image[white[1], white[0]])


def search_copy(image: Image) -> tuple[Image, Array]:
    """An image in which to search first, at most `SEARCH_PX` wide and high, and its pixels' width and height, (2,)."""
    height, width = image.shape
    share = SEARCH_PX / max(height, width)
    if share >= 1.0:
        return image, np.ones(2)
    size = max(round(width * share), 1), max(round(height * share), 1)
    small = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    return small, np.array([width / size[0], height / size[1]])


def marker_ink(name: str, marker: int) -> Array:
    """What is black of a marker: x, y, width, height of bars that do not overlap, (r, 4) in units of its edge.

    Args:
        name: a dictionary of OpenCV.
        marker: id of the marker.
    """
    modules = marker_modules(name)
    code = cv2.aruco.generateImageMarker(dictionary(name), marker, modules)
    bars = []
    for row, dark in enumerate(np.pad(code == 0, ((0, 0), (1, 1)))):
        change = np.flatnonzero(np.diff(dark.astype(np.int8)))
        bars += [(start, row, end - start, 1) for start, end in zip(change[::2], change[1::2], strict=True)]
    return np.array(bars, np.float64) / modules


@lru_cache(maxsize=4)
def _charuco_detector(board: Board) -> Any:
    size = board.columns, board.rows
    layout = cv2.aruco.CharucoBoard(size, board.square, board.marker, dictionary(board.dictionary))
    layout.setLegacyPattern(board.legacy)
    return cv2.aruco.CharucoDetector(layout)


def _share(start: float, end: float, count: int) -> tuple[slice, Array]:
    """Which of `count` pixels lie between two places, and the share of each that does."""
    first, last = max(math.floor(start), 0), min(math.ceil(end), count)
    edges = np.arange(first, last)
    return slice(first, last), np.clip(np.minimum(edges + 1, end) - np.maximum(edges, start), 0, 1)


def printed_board(
    kind: Kind,
    columns: int | None = None,
    rows: int | None = None,
    square_mm: float | None = None,
    marker_mm: float | None = None,
    dictionary: str = DICTIONARY,
    legacy: bool = False,
) -> Board:
    """Make a board from millimetres; `DEFAULT_SIZES` gives what is left out, and a marker is 7/9 of a square.

    Raises:
        ConfigError: there is no such board.
    """
    one_of("board", kind, DEFAULT_SIZES)
    default = DEFAULT_SIZES[kind]
    square = default[2] / 1000 if square_mm is None else metres(square_mm, "square_mm")
    return Board(
        kind=kind,
        columns=default[0] if columns is None else columns,
        rows=default[1] if rows is None else rows,
        square=square,
        marker=square * 28 / 36 if marker_mm is None else metres(marker_mm, "marker_mm"),
        dictionary=dictionary,
        legacy=legacy,
    )


def metres(millimetres: float, name: str) -> float:
    """Turn a length on paper into metres.

    Raises:
        ConfigError: the length is none of a board; less than a millimetre is rather one in metres.
    """
    if 0 < millimetres < 1:
        raise ConfigError(f"{name} = {millimetres:g}: is that metres? In millimetres it is {1000 * millimetres:g}")
    if not is_number(millimetres) or not 1 <= millimetres <= 1000 * _LENGTHS[1]:
        raise ConfigError(f"{name} = {millimetres:g}: expected a length of 1 to {1000 * _LENGTHS[1]:g}, in mm")
    return millimetres / 1000
