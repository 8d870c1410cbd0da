"""Views of a calibration board: which of them are of use, which are not and why, and how they cover the image."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array, Image
from tral_env.calibration.board_hints import BoardHint, other_board
from tral_env.calibration.boards import Board

GRID = (9, 6)
"""The coverage map has so many cells across and down: three by two in each ninth of the image."""
MIN_CORNERS = 8
"""A view with fewer corners tells little about the lens and may not fix its own pose."""
EDGE_PX = 5.0
"""Edges that take more pixels than this from black to white are blurred: motion, or out of focus. A sharp edge of a
rendered or good camera takes 2 to 3. Images wider than 1280 px are allowed more in proportion."""
SAME_POSE = 0.01
"""Views whose common corners lie closer than this share of the image's diagonal on average are one view."""


@dataclass(frozen=True, eq=False)
class View:
    """Corners of the board in one image."""

    name: str
    """Name of the image."""
    ids: NDArray[np.int64]
    """(k,) corners of the board, rows of `Board.corners`."""
    pixels: Array
    """(k, 2) their places in the image, px."""
    edge_px: float
    """An edge takes so many pixels from black to white, along the direction in which it is most blurred."""


@dataclass(frozen=True)
class Rejected:
    """An image that is not used."""

    name: str
    """Name of the image."""
    reason: str
    """One of `REASONS`."""
    detail: str
    """What was got, and what is allowed."""
    hint: BoardHint | None = None
    """Which other board it shows, if that is known."""


REASONS = ("unreadable", "other size", "no board", "too few corners", "too blurred", "duplicate pose", "outlier error")
"""An image is rejected for one of these, in the order of the checks."""


@dataclass
class Collection:
    """Images on their way to a calibration: shown one by one, each used or rejected.

    A calibration holds for one size of image: the one with the most views, and of equals the one that came first.
    """

    board: Board
    _views: dict[tuple[int, int], list[View]] = field(default_factory=dict)
    """The views of each size of image, in the order in which the sizes came."""
    _rejected: list[Rejected] = field(default_factory=list)
    _without_board: int = 0
    _hinted: bool = False

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height of the images, px; None before the first."""
        return max(self._views, key=lambda size: len(self._views[size]), default=None)

    @property
    def views(self) -> list[View]:
        """The views that are of use."""
        return self._views[self.size] if self.size else []

    @property
    def rejected(self) -> list[Rejected]:
        """The images that are not used, those of another size last."""
        others = [(size, view) for size, views in self._views.items() if size != self.size for view in views]
        return [*self._rejected, *(Rejected(view.name, "other size", self._told(size)) for size, view in others)]

    def _told(self, size: tuple[int, int]) -> str:
        assert self.size
        turned = "; was the camera turned?" if size == self.size[::-1] else ""
        return f"{size[0]} x {size[1]} px, most are {self.size[0]} x {self.size[1]}{turned}"

    def add(self, name: str, image: Image | None) -> View | Rejected:
        """Look at an image, and keep it as a view or as a rejected one.

        Args:
            name: name of the image in messages.
            image: (h, w) grey or (h, w, 3) of any order of colours, uint8; None: it could not be read.

        Returns:
            The view or the reason; a view is used if most others have its size in the end.
        """
        if image is None:
            seen: View | Rejected = Rejected(name, "unreadable", "damaged, empty or not to be opened")
        else:
            grey = image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
            alike = self._views.setdefault((grey.shape[1], grey.shape[0]), [])
            seen = self._judge(name, grey, alike)
            if isinstance(seen, View):
                alike.append(seen)
        if isinstance(seen, Rejected):
            self._rejected.append(seen)
        return seen

    def _hint(self, grey: Image) -> BoardHint | None:
        """Which other board it may be; looked for in the first, second, fourth, eighth ... empty image until something
        is found.
        """
        self._without_board += 1
        due = self._without_board.bit_count() == 1 and not self._hinted
        hint = other_board(self.board, grey) if due else None
        self._hinted = self._hinted or hint is not None
        return hint

    def _judge(self, name: str, grey: Image, alike: list[View]) -> View | Rejected:
        """Make an image a view, if it is of use beside the views of its size."""
        ids, pixels = self.board.find(grey)
        if not len(ids):
            told = "no corner was found: not in view, too blurred or too small"
            return Rejected(name, "no board", told, self._hint(grey))
        if len(ids) < MIN_CORNERS or not _spread(self.board, ids):
            return Rejected(name, "too few corners", f"{len(ids)} of {len(self.board.corners)} corners")
        edge = edge_width(self.board, grey, ids, pixels)
        if edge > (limit := EDGE_PX * max(1.0, grey.shape[1] / 1280)):
            return Rejected(name, "too blurred", f"edges are {edge:.1f} px wide, allowed {limit:.1f}")
        view = View(name, ids, pixels, edge)
        for other in alike:
            if _apart(view, other) < SAME_POSE * np.hypot(*grey.shape):
                return Rejected(name, "duplicate pose", f"as in {other.name}")
        return view

    def coverage(self) -> NDArray[np.int64]:
        """Corners in each cell of the image, as the function `coverage` counts them."""
        return coverage(self.views, self.size or (1, 1))

    def reasons(self) -> dict[str, int]:
        """Number of images rejected for each reason."""
        counts = Counter(one.reason for one in self.rejected)
        return {reason: counts[reason] for reason in REASONS if counts[reason]}


def coverage(views: list[View], size: tuple[int, int]) -> NDArray[np.int64]:
    """Count the corners in each cell of the image.

    Args:
        views: views of a board.
        size: width and height of the image, px.

    Returns:
        (rows, columns) of `GRID`, upper left cell first.
    """
    pixels = np.concatenate([np.zeros((0, 2)), *(view.pixels for view in views)])
    edges = [np.linspace(-0.5, length - 0.5, cells + 1) for length, cells in zip(size, GRID, strict=True)]
    counts, _, _ = np.histogram2d(pixels[:, 1], pixels[:, 0], bins=(edges[1], edges[0]))
    return np.asarray(counts, np.int64)


def edge_width(board: Board, grey: Image, ids: NDArray[np.int64], pixels: Array) -> float:
    """Pixels an edge takes from black to white: at each corner the worse of its two edges, and the median of these.

    The width is the contrast of a patch around the corner over the steepest change in it, by Sobel's filter: 2 for the
    sharpest possible edge, m for motion by m px, about sqrt(4 + 6 s^2) for a Gaussian blur of standard deviation s.

    Args:
        board: the board.
        grey: (h, w) image.
        ids: (k,) corners of the board.
        pixels: (k, 2) their places in the image, px.
    """
    image = np.asarray(grey, np.float32)
    slopes = np.stack(
        [cv2.Sobel(image, cv2.CV_32F, 1, 0, scale=1 / 8), cv2.Sobel(image, cv2.CV_32F, 0, 1, scale=1 / 8)]
    )
    across, down = _edges(board, ids, pixels)
    widths = []
    for (x, y), *edges in zip(np.rint(pixels).astype(int), across, down, strict=True):
        reach = int(np.clip(0.3 * min(np.linalg.norm(edge) for edge in edges), 3, 12))
        patch = np.s_[max(y - reach, 0) : y + reach + 1, max(x - reach, 0) : x + reach + 1]
        low, high = np.percentile(image[patch], (2, 98))
        steepest = [_steepest(slopes[:, *patch], edge) for edge in edges]
        widths.append((high - low) / max(min(steepest), 1e-6))
    return float(np.median(widths))


def _steepest(slope: NDArray[Any], edge: Array) -> float:
    """Largest change across an edge of this direction in a patch of slopes (2, h, w), grey levels a pixel."""
    normal = np.array([-edge[1], edge[0]]) / np.linalg.norm(edge)
    return float(np.abs(np.tensordot(normal, slope, 1)).max())


def _edges(board: Board, ids: NDArray[np.int64], pixels: Array) -> tuple[Array, Array]:
    """Edges of a square to the right and down at each corner, by the homography of the board, (k, 2) px each."""
    flat = board.corners[ids][:, :2]
    turn, _ = cv2.findHomography(flat, pixels)

    def seen(points: Array) -> Array:
        return np.asarray(cv2.perspectiveTransform(points[None], turn)[0], np.float64)

    right, below = np.array([board.square / 2, 0.0]), np.array([0.0, board.square / 2])
    return seen(flat + right) - seen(flat - right), seen(flat + below) - seen(flat - below)


def _spread(board: Board, ids: NDArray[np.int64]) -> bool:
    """Whether corners span a plane: at least two rows and two columns hold some, and three of one of both."""
    rows, columns = np.unique(ids // (board.columns - 1)), np.unique(ids % (board.columns - 1))
    return min(len(rows), len(columns)) >= 2 and max(len(rows), len(columns)) >= 3


def _apart(one: View, other: View) -> float:
    """Mean distance of the corners that two views share, px; infinite if they share less than half."""
    common, mine, theirs = np.intersect1d(one.ids, other.ids, return_indices=True)
    if 2 * len(common) < max(len(one.ids), len(other.ids)):
        return float("inf")
    return float(np.linalg.norm(one.pixels[mine] - other.pixels[theirs], axis=1).mean())
