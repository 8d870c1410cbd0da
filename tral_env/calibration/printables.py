"""Pages to print: calibration boards, and the markers of signs and gates."""

from __future__ import annotations

import numpy as np

from tral_env.calibration.boards import Board, marker_ink, metres
from tral_env.calibration.sheet import PAPERS, Sheet, Text, paper_size, ruler
from tral_env.checks import check_number
from tral_env.errors import ConfigError
from tral_env.geometry import MARKER_MODULES, MARKER_QUIET_MODULES, MARKER_SIZE_M
from tral_env.interface import DICTIONARY_SIZE, GATE_IDS
from tral_env.perception.aruco import DICTIONARY

EDGE_MM = 8.0
"""The edges of a board's page stay white for this much: most printers leave out 4 to 6 mm."""
FOOT_MM = 18.0
"""The foot of a board's page, with ruler and text, is this high."""
FOOT_LEFT_MM = 20.0
"""Ruler and text begin at most this far from the left edge, so that they end on the page below a small board too."""
MIN_QUIET = 0.5
"""The detector needs so many cells of white around a marker: with a quarter on a black wall it loses markers between 10
and 14 px that it reads with this."""
SIZE_MM = 1000 * MARKER_SIZE_M
"""The black square of a gate's marker has this edge."""


def board_sheet(board: Board, paper: str = "A4") -> Sheet:
    """Put a calibration board on one page, lying if that fits and else upright.

    Raises:
        ConfigError: the board does not fit; the message says which would.
    """
    width, height = (1000 * length for length in board.size)
    for landscape in (True, False):
        page = paper_size(paper, landscape=landscape)
        if width + 2 * EDGE_MM <= page[0] and height + EDGE_MM + FOOT_MM <= page[1]:
            break
    else:
        page = paper_size(paper, landscape=True)
        least = min((page[0] - 2 * EDGE_MM) / board.columns, (page[1] - EDGE_MM - FOOT_MM) / board.rows)
        raise ConfigError(
            f"a board of {board.columns} x {board.rows} squares of {1000 * board.square:g} mm is {width:g} x "
            f"{height:g} mm and does not fit on {paper}: squares of {np.floor(10 * least) / 10:g} mm would. "
            f"Papers: {', '.join(PAPERS)}"
        )
    left, top = (page[0] - width) / 2, EDGE_MM + (page[1] - height - EDGE_MM - FOOT_MM) / 2
    kind = f"{board.kind}, {board.columns} x {board.rows} squares of {1000 * board.square:g} mm"
    if board.kind == "charuco":
        kind += f", markers of {1000 * board.marker:g} mm, {board.dictionary}{', legacy' * board.legacy}"
    foot = min(left, FOOT_LEFT_MM)
    lines, text = ruler(foot, page[1] - 9.0)
    ink = 1000 * board.black + np.array([left, top, 0.0, 0.0])
    return Sheet("board", *page, ink, lines, (text, Text(foot, page[1] - 12.2, kind, 2.6)))


def marker_sheet(marker: int, size_mm: float = SIZE_MM, paper: str = "A4", note: str = "") -> Sheet:
    """Put a marker of DICT_4X4_50 on one page, as high up as its white border allows.

    Args:
        marker: id of the marker.
        size_mm: edge of the black square.
        paper: "A4" or "A3".
        note: a text beside the id.

    Raises:
        ConfigError: there is no such marker, or it does not fit with the white that it needs.
    """
    check_number("marker", marker, whole=True)
    if not 0 <= marker < DICTIONARY_SIZE:
        raise ConfigError(f"marker {marker}: DICT_4X4_50 has 0 to {DICTIONARY_SIZE - 1}")
    check_number("size_mm", size_mm, "mm")
    if not size_mm > 0:
        raise ConfigError(f"size_mm = {size_mm:g}: expected a length above 0")
    metres(size_mm, "size_mm")
    page = paper_size(paper)
    cell = size_mm / MARKER_MODULES
    most = page[0] / (1 + 2 * MIN_QUIET / MARKER_MODULES)  # its height leaves more than enough on every paper
    if size_mm > most:
        raise ConfigError(
            f"a marker of {size_mm:g} mm needs {MIN_QUIET * cell:g} mm of white on either side and does not fit on "
            f"{paper}: {np.floor(most):g} mm would. Papers: {', '.join(PAPERS)}"
        )
    left, top = (page[0] - size_mm) / 2, MARKER_QUIET_MODULES * cell + 8.0
    ink = size_mm * marker_ink(DICTIONARY, marker) + np.array([left, top, 0.0, 0.0])
    foot = top + size_mm + MARKER_QUIET_MODULES * cell + 8.0
    lines, text = ruler(20.0, foot)
    told = f"marker {marker}, {size_mm:g} mm, DICT_4X4_50{', ' + note if note else ''}; this way up"
    texts = [text, Text(20.0, foot + 9.0, told)]
    if left < MARKER_QUIET_MODULES * cell:
        needed = (
            f"Mount on white card: {MARKER_QUIET_MODULES * cell:.4g} mm of white all around, "
            f"{left:.4g} are on this paper."
        )
        texts.append(Text(20.0, foot + 14.0, needed))
    return Sheet(str(marker), *page, ink, (*lines, *_crop_marks(left, top, size_mm, cell, page)), tuple(texts))


def gate_sheets(gate: int, size_mm: float = SIZE_MM, paper: str = "A4") -> list[Sheet]:
    """Put the left and the right marker of a gate on a page each.

    Raises:
        ConfigError: there is no such gate, or a marker does not fit.
    """
    check_number("gate", gate, whole=True)
    if gate not in GATE_IDS:
        raise ConfigError(f"gate {gate}: there are {GATE_IDS[0]} to {GATE_IDS[-1]}")
    sides = ("left", "right")
    return [
        marker_sheet(2 * gate + i, size_mm, paper, f"gate {gate}, {side} in driving direction")
        for i, side in enumerate(sides)
    ]


def _crop_marks(
    left: float, top: float, size: float, cell: float, page: tuple[float, float]
) -> list[tuple[float, float, float, float]]:
    """Strokes outside the corners of the white border, as far as they are on the page."""
    x, y = (
        (left - MARKER_QUIET_MODULES * cell, left + size + MARKER_QUIET_MODULES * cell),
        (top - MARKER_QUIET_MODULES * cell, top + size + MARKER_QUIET_MODULES * cell),
    )
    marks = [(u, v - 4 * out, u, v - 1 * out) for u in x for v, out in zip(y, (1, -1), strict=True)]
    marks += [(u - 4 * out, v, u - 1 * out, v) for v in y for u, out in zip(x, (1, -1), strict=True)]
    return [mark for mark in marks if min(mark) >= 0 and max(mark[::2]) <= page[0] and max(mark[1::2]) <= page[1]]
