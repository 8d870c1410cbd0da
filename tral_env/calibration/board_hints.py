"""Which other board an image shows, when the named one is not in it: the options that would find it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from tral_env.arrays import Image
from tral_env.calibration.boards import Board, search_copy
from tral_env.errors import ConfigError
from tral_env.perception.aruco import fitting_dictionaries

MIN_MARKERS = 3
"""An image with fewer markers of a dictionary may show a window that looks like one."""


def other_board(board: Board, grey: Image) -> str:
    """Tell which board an image shows, and by which options.

    Args:
        board: the board that was not found.
        grey: (h, w) uint8.

    Returns:
        A clause for the end of a message; empty: the image shows no board that differs little from the named one.
    """
    grey, _ = search_copy(grey)
    if board.kind == "chessboard":
        return _other_chessboard(board, grey)
    for other in _alike(board):
        if len(other.find(grey)[0]):
            return f"the image shows another board: {_options(board, other)}"
    return _other_markers(board, grey)


def _other_chessboard(board: Board, grey: Image) -> str:
    inner = f"{board.columns} x {board.rows}"
    more = _changed(board, columns=board.columns + 1, rows=board.rows + 1)
    if more and len(more.find(grey)[0]):
        return f"{inner} inner corners are {more.columns} x {more.rows} squares: {_options(board, more)}"
    if fitting_dictionaries(grey, MIN_MARKERS):
        return "the image shows markers: is it --board charuco?"
    return ""


def _alike(board: Board) -> Iterator[Board]:
    """Boards with the same markers whose squares are arranged or counted in another way."""
    turned = _changed(board, columns=board.rows, rows=board.columns)
    more = _changed(board, columns=board.columns + 1, rows=board.rows + 1)
    for one in (board, turned, more):
        for legacy in (board.legacy, not board.legacy):
            if one is not None and (one is not board or legacy != board.legacy):
                yield replace(one, legacy=legacy)


def _changed(board: Board, **changes: Any) -> Board | None:
    """The board with other values; None if there is none, such as one with more markers than its dictionary."""
    try:
        return replace(board, **changes)
    except ConfigError:
        return None


def _other_markers(board: Board, grey: Image) -> str:
    fitting = fitting_dictionaries(grey, MIN_MARKERS)
    if not fitting:
        return ""
    name = next(iter(fitting))
    if name == board.dictionary:
        return f"the image shows {fitting[name]} markers of {name}: are --columns and --rows those of the board?"
    for legacy in (board.legacy, not board.legacy):
        other = _changed(board, dictionary=name, legacy=legacy)
        if other and len(other.find(grey)[0]):
            return f"the image shows another board: {_options(board, other)}"
    return f"the image shows {fitting[name]} markers of {name}: try --dictionary {name.removeprefix('DICT_')}"


def _options(board: Board, other: Board) -> str:
    """Options in which one board differs from another."""
    told = [
        f"--{name} {getattr(other, name)}"
        for name in ("columns", "rows")
        if getattr(other, name) != getattr(board, name)
    ]
    if other.dictionary != board.dictionary:
        told.append(f"--dictionary {other.dictionary.removeprefix('DICT_')}")
    if other.legacy != board.legacy:
        told.append("--legacy" if other.legacy else "without --legacy")
    return " ".join(told)
