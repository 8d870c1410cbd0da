"""Options of the commands that print or look at a calibration board."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

if TYPE_CHECKING:
    from tral_env.calibration.board_hints import BoardHint

BoardKind = Literal["charuco", "chessboard"]
Kind = Annotated[BoardKind, typer.Option(help="Kind of the board.")]
Columns = Annotated[int | None, typer.Option(min=3, help="Squares in a row; default: 7, chessboard: 10.")]
Rows = Annotated[int | None, typer.Option(min=3, help="Squares in a column; default: 5, chessboard: 7.")]
SquareMm = Annotated[float | None, typer.Option(help="Edge of a square, mm; default: 36, chessboard: 25.")]
MarkerMm = Annotated[float | None, typer.Option(help="Edge of a charuco marker, mm; default: 7/9 of a square.")]
Dictionary = Annotated[str, typer.Option(help="Dictionary of a charuco board's markers, such as 4X4_50 or 6X6_250.")]
Legacy = Annotated[
    bool, typer.Option("--legacy", help="Charuco board with a white upper left square, as OpenCV before 4.6 drew it.")
]


def hint_as_options(hint: BoardHint) -> str:
    """Word a hint at another board by the options of the command that would find it."""
    options = " ".join(_option(name, value) for name, value in hint.fields.items())
    return f"{hint.told}: {options}" if options else hint.told


def _option(name: str, value: Any) -> str:
    if name == "legacy":
        return "--legacy" if value else "without --legacy"
    given = str(value).removeprefix("DICT_") if name == "dictionary" else value
    return f"--{'board' if name == 'kind' else name} {given}"
