"""Which other board an image shows, when the named one is not in it: the fields of `Board` that would find it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from tral_env.arrays import Image
from tral_env.calibration.boards import Board, search_copy
from tral_env.errors import ConfigError
from tral_env.perception.aruco import fitting_dictionaries

MIN_MARKERS = 3
"""An image with fewer markers of a dictionary may show a window that looks like one."""


@dataclass(frozen=True)
class BoardHint:
    """Which other board an image shows."""

    told: str
    """What the image shows, a clause."""
    fields: Mapping[str, Any] = field(default_factory=dict)
    """The fields of `Board` that have other values, and these; empty: not known."""

    def __str__(self) -> str:
        """The clause, and the fields as arguments of Python."""
        changes = ", ".join(f"{name}={value!r}" for name, value in self.fields.items())
        return f"{self.told}: {changes}" if changes else self.told


def other_board(board: Board, grey: Image) -> BoardHint | None:
    """Tell which board an image shows.

    Args:
        board: the board that was not found.
        grey: (h, w) uint8.

    Returns:
        The hint; None: the image shows no board that differs little from the named one.
    """
    grey, _ = search_copy(grey)
    if board.kind == "chessboard":
        return _other_chessboard(board, grey)
    for other in _alike(board):
        if len(other.find(grey)[0]):
            return _other(board, other)
    return _other_markers(board, grey)


def _other_chessboard(board: Board, grey: Image) -> BoardHint | None:
    inner = f"{board.columns} x {board.rows}"
    more = _changed(board, columns=board.columns + 1, rows=board.rows + 1)
    if more and len(more.find(grey)[0]):
        told = f"{inner} inner corners are {more.columns} x {more.rows} squares"
        return BoardHint(told, {"columns": more.columns, "rows": more.rows})
    if fitting_dictionaries(grey, MIN_MARKERS):
        return BoardHint("the image shows markers", {"kind": "charuco"})
    return None


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


def _other_markers(board: Board, grey: Image) -> BoardHint | None:
    fitting = fitting_dictionaries(grey, MIN_MARKERS)
    if not fitting:
        return None
    name = next(iter(fitting))
    told = f"the image shows {fitting[name]} markers of {name}"
    if name == board.dictionary:
        return BoardHint(f"{told}: are columns and rows those of the board?")
    for legacy in (board.legacy, not board.legacy):
        other = _changed(board, dictionary=name, legacy=legacy)
        if other and len(other.find(grey)[0]):
            return _other(board, other)
    return BoardHint(told, {"dictionary": name})


def _other(board: Board, other: Board) -> BoardHint:
    """The hint at another board, by the fields in which it differs."""
    names = ("columns", "rows", "dictionary", "legacy")
    changes = {name: getattr(other, name) for name in names if getattr(other, name) != getattr(board, name)}
    return BoardHint("the image shows another board", changes)
