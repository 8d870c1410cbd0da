"""`tral print`: boards, markers and gates at true size, as PDF or SVG."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from tral_env.atomic import write_bytes
from tral_env.errors import ConfigError
from tral_fsm.cli import board_options
from tral_fsm.evaluation.files import prepare_folder

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tral_env.calibration.sheet import Sheet

Paper = Literal["A4", "A3"]

app = typer.Typer(no_args_is_help=True, help="Print boards, markers and gates at true size, as PDF or SVG.")

_Paper = Annotated[Paper, typer.Option(help="Size of the paper.")]
_Out = Annotated[
    Path | None,
    typer.Option(
        dir_okay=False, help="A .pdf, or a .svg for each page; default: a .pdf in this folder.", show_default=False
    ),
]
_Size = Annotated[float, typer.Option(help="Edge of the black square, mm; the car expects 180.")]


@app.command()
def board(
    board: board_options.Kind = "charuco",
    columns: board_options.Columns = None,
    rows: board_options.Rows = None,
    square_mm: board_options.SquareMm = None,
    marker_mm: board_options.MarkerMm = None,
    dictionary: board_options.Dictionary = "5X5_50",
    legacy: board_options.Legacy = False,
    paper: _Paper = "A4",
    out: _Out = None,
) -> None:
    """Print a calibration board; `tral calibrate` takes the same options."""
    from tral_env.calibration.boards import printed_board
    from tral_env.calibration.printables import board_sheet

    made = printed_board(board, columns, rows, square_mm, marker_mm, dictionary, legacy)
    _save([board_sheet(made, paper)], out or Path(f"{board}.pdf"))


@app.command()
def marker(
    ids: Annotated[list[int], typer.Argument(help="Ids of the markers, 0 to 49; each gets a page.")],
    size_mm: _Size = 180.0,
    paper: _Paper = "A4",
    out: _Out = None,
) -> None:
    """Print single markers: 40 turn left, 41 turn right, 42 straight on; 0 to 39 belong to gates."""
    from tral_env.calibration.printables import marker_sheet

    names = "_".join(str(one) for one in ids)
    _save([marker_sheet(one, size_mm, paper) for one in ids], out or Path(f"marker_{names}.pdf"))


@app.command()
def gate(
    number: Annotated[int, typer.Argument(help="Number of the gate, 0 to 19; gate k has the markers 2k and 2k + 1.")],
    size_mm: _Size = 180.0,
    paper: _Paper = "A4",
    out: _Out = None,
) -> None:
    """Print the two markers of a gate."""
    from tral_env.calibration.printables import gate_sheets

    _save(gate_sheets(number, size_mm, paper), out or Path(f"gate_{number}.pdf"))


def _save(sheets: Sequence[Sheet], out: Path) -> None:
    from tral_env.calibration.sheet import page_suffix, printed

    page_suffix(out)  # a bad suffix is an error before a folder is made
    prepare_folder(out.parent)
    pages = printed(sheets, out)
    try:
        for file, content in pages.items():
            write_bytes(file, content)
    except OSError as error:
        raise ConfigError(f"--out {out}: cannot be written: {error.strerror}") from error
    for sheet in sheets:
        for text in sheet.texts[1:]:
            typer.echo(text.text)
    typer.echo(f"Written: {', '.join(str(path) for path in pages)}; print at 100 %, not fitted to the page")
