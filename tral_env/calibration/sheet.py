"""Pages to print at true size, as SVG or PDF: black areas, thin lines and text, in millimetres."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

import numpy as np

from tral_env.arrays import Array
from tral_env.errors import ConfigError, nearest

if TYPE_CHECKING:
    from matplotlib.figure import Figure


PAPERS = {"A4": (210.0, 297.0), "A3": (297.0, 420.0)}
"""Each paper has this width and height, upright, mm."""
RULER_MM = 100.0
"""The ruler on each page is this long."""
_MM_PER_INCH = 25.4
_POINTS_PER_INCH = 72.0
_LINE_MM = 0.2


@dataclass(frozen=True)
class Text:
    """A line of text; its baseline begins at a place, mm from the upper left corner of the page."""

    x: float
    y: float
    text: str
    height: float = 3.5
    """Size of its type, mm."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """One page; x counts to the right and y down from its upper left corner, mm."""

    name: str
    """Its part of the file's name, when each page has a file of its own."""
    width: float
    height: float
    ink: Array
    """Black rectangles, (r, 4): x, y, width, height."""
    lines: tuple[tuple[float, float, float, float], ...] = ()
    """Thin lines from x, y to x, y."""
    texts: tuple[Text, ...] = field(default=())


def paper_size(name: str, *, landscape: bool = False) -> tuple[float, float]:
    """Width and height of a paper, mm.

    Raises:
        ConfigError: there is no such paper.
    """
    if name.upper() not in PAPERS:
        raise ConfigError(f"unknown paper '{name}': {nearest(name.upper(), PAPERS)}")
    width, height = PAPERS[name.upper()]
    return (height, width) if landscape else (width, height)


def ruler(x: float, y: float) -> tuple[tuple[tuple[float, float, float, float], ...], Text]:
    """Draw a line of 100 mm with a stroke each 10 mm, and tell what it is for.

    Args:
        x: place of its left end, mm.
        y: place of the line, mm; strokes rise 2 mm from it, its text stands 3.5 mm below.
    """
    ticks = [(x + mm, y, x + mm, y - (2.0 if mm % 50 == 0 else 1.2)) for mm in np.arange(0.0, RULER_MM + 1, 10.0)]
    text = "This line is 100 mm long. If it is not, print again at 100 %, not fitted to the page."
    return ((x, y, x + RULER_MM, y), *((float(a), b, float(c), d) for a, b, c, d in ticks)), Text(x, y + 3.5, text, 2.8)


def to_svg(sheet: Sheet) -> str:
    """Write a page as SVG, one user unit a millimetre.

    All that is black is one path, because rectangles side by side would show hairlines between them.
    """
    path = "".join(f"M{x:.10g} {y:.10g}h{w:.10g}v{h:.10g}h{-w:.10g}z" for x, y, w, h in sheet.ink)
    lines = "".join(f"M{x:.10g} {y:.10g}L{u:.10g} {v:.10g}" for x, y, u, v in sheet.lines)
    texts = "".join(
        f'<text x="{text.x:.10g}" y="{text.y:.10g}" font-size="{text.height:.10g}">{escape(text.text)}</text>\n'
        for text in sheet.texts
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{sheet.width:g}mm" height="{sheet.height:g}mm" '
        f'viewBox="0 0 {sheet.width:g} {sheet.height:g}" font-family="sans-serif">\n'
        f'<rect width="{sheet.width:g}" height="{sheet.height:g}" fill="white"/>\n'
        f'<path id="ink" fill="black" d="{path}"/>\n'
        f'<path id="lines" fill="none" stroke="black" stroke-width="{_LINE_MM}" d="{lines}"/>\n'
        f"{texts}</svg>\n"
    )


def to_figure(sheet: Sheet) -> Figure:
    """Draw a page as a figure of the same size."""
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    figure = Figure(figsize=(sheet.width / _MM_PER_INCH, sheet.height / _MM_PER_INCH))
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_xlim(0.0, sheet.width)
    ax.set_ylim(sheet.height, 0.0)
    ax.set_axis_off()
    x, y, w, h = sheet.ink.T
    corners = np.stack([x, y, x + w, y, x + w, y + h, x, y + h, x, y], axis=1).reshape(-1, 2)
    codes = [Outline.MOVETO, Outline.LINETO, Outline.LINETO, Outline.LINETO, Outline.CLOSEPOLY] * len(sheet.ink)
    ax.add_patch(PathPatch(Outline(corners, codes), facecolor="black", linewidth=0.0))
    points_per_mm = _POINTS_PER_INCH / _MM_PER_INCH
    strokes = [((a, b), (c, d)) for a, b, c, d in sheet.lines]
    ax.add_collection(LineCollection(strokes, colors="black", linewidths=_LINE_MM * points_per_mm), autolim=False)
    for text in sheet.texts:
        ax.text(text.x, text.y, text.text, fontsize=text.height * points_per_mm, va="baseline", parse_math=False)
    return figure


def page_suffix(out: Path) -> str:
    """Kind of a file, ".pdf" or ".svg", by its name.

    Raises:
        ConfigError: the name ends in neither.
    """
    suffix = out.suffix.lower()
    if suffix not in (".pdf", ".svg"):
        raise ConfigError(f"{out}: unknown suffix '{out.suffix}'. Allowed: .pdf, .svg")
    return suffix


def printed(sheets: Sequence[Sheet], out: Path) -> dict[Path, bytes]:
    """Make the files that hold pages: a PDF with all of them, or an SVG for each.

    Args:
        sheets: the pages.
        out: a .pdf or .svg; several SVGs get the names of their pages before the suffix.

    Returns:
        Content of each file; nothing is written.

    Raises:
        ConfigError: `out` has another suffix.
    """
    if page_suffix(out) == ".pdf":
        return {out: _pdf(sheets)}
    if len(sheets) == 1:
        return {out: to_svg(sheets[0]).encode("utf-8")}
    return {out.with_name(f"{out.stem}_{sheet.name}{out.suffix}"): to_svg(sheet).encode("utf-8") for sheet in sheets}


def _pdf(sheets: Sequence[Sheet]) -> bytes:
    import matplotlib as mpl
    from matplotlib.backends.backend_pdf import PdfPages

    content = io.BytesIO()
    with mpl.rc_context({"pdf.fonttype": 42}), PdfPages(content, metadata={"CreationDate": None}) as pages:
        for sheet in sheets:
            pages.savefig(to_figure(sheet))
    return content.getvalue()
