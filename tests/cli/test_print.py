"""Printed pages have their true size, and the detectors read them."""

from __future__ import annotations

import re
import zlib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner, Result

from tral_env.calibration.boards import Board
from tral_env.calibration.printables import board_sheet, gate_sheets, marker_sheet
from tral_env.calibration.sheet import PAPERS, Sheet
from tral_env.course.markers import marker_image
from tral_env.errors import ConfigError
from tral_env.perception.aruco import Detector
from tral_fsm.cli import app

SVG = "{http://www.w3.org/2000/svg}"
PIXELS_PER_MM = 4
POINTS_PER_MM = 72 / 25.4


def tral(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def rasterised(path: Path) -> np.ndarray:
    """A page as a scanner at 4 px/mm would see it: its rectangles alone."""
    root = ElementTree.parse(path).getroot()
    width, height = (float(root.attrib[name].removesuffix("mm")) for name in ("width", "height"))
    assert root.attrib["viewBox"] == f"0 0 {width:g} {height:g}"
    image = np.full((round(height * PIXELS_PER_MM), round(width * PIXELS_PER_MM)), 255, np.uint8)
    (ink,) = (part.attrib["d"] for part in root.iter(f"{SVG}path") if part.attrib["id"] == "ink")
    for x, y, w, h in re.findall(r"M(\S+) (\S+)h([\d.]+)v([\d.]+)h-[\d.]+z", ink):
        left, top, right, bottom = (
            round(value * PIXELS_PER_MM) for value in (float(x), float(y), float(x) + float(w), float(y) + float(h))
        )
        image[top:bottom, left:right] = 0
    return image


def pdf_pages(path: Path) -> list[tuple[tuple[float, float], np.ndarray]]:
    """Size of each page, mm, and the ends of all lines on it, mm from the lower left."""
    data = path.read_bytes()
    sizes = [
        tuple(float(value) / POINTS_PER_MM for value in box)
        for box in re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", data)
    ]
    drawn = []
    for stream in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", data, re.DOTALL):
        text = zlib.decompress(stream)
        if text.count(b" l\n") > 20:
            drawn.append(np.array(re.findall(rb"([\d.]+) ([\d.]+) [ml]\n", text), float) / POINTS_PER_MM)
    assert len(sizes) == len(drawn)
    return list(zip(sizes, drawn, strict=True))


def test_a_gate_is_two_pages_with_its_two_markers(tmp_path: Path) -> None:
    result = tral("print", "gate", 3, "--out", tmp_path / "gate.svg")
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gate_6.svg", "gate_7.svg"]
    assert "gate 3, left" in result.stdout
    for marker in (6, 7):
        found = Detector().detect(rasterised(tmp_path / f"gate_{marker}.svg"))
        assert found.ids.tolist() == [marker]


def test_a_marker_has_its_true_size_and_stands_upright(tmp_path: Path) -> None:
    tral("print", "marker", 40, "--out", tmp_path / "m.svg")
    (corners,) = Detector().detect(rasterised(tmp_path / "m.svg")).corners
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1) / PIXELS_PER_MM
    assert sides == pytest.approx([180.0] * 4, abs=0.2)
    assert corners[0, 0] < corners[1, 0]
    assert corners[0, 1] < corners[3, 1]


def test_a_marker_is_that_of_the_courses() -> None:
    sheet = marker_sheet(17, 60.0)
    ink = (sheet.ink - [*sheet.ink[0, :2], 0, 0]) / 10.0
    drawn = np.full((6, 6), 255)
    for x, y, w, h in np.rint(ink).astype(int):
        drawn[y : y + h, x : x + w] = 0
    assert (drawn == marker_image(17)[8:-8:8, 8:-8:8]).all()


def test_a_board_on_paper_is_read_where_it_is_printed(tmp_path: Path) -> None:
    tral("print", "board", "--out", tmp_path / "b.svg")
    board = Board()
    ids, pixels = board.find(rasterised(tmp_path / "b.svg"))
    assert sorted(ids) == list(range(24))
    left, top = board_sheet(board).ink[0, :2]
    expected = (board.corners[ids, :2] * 1000 + [left, top]) * PIXELS_PER_MM - 0.5
    assert pixels == pytest.approx(expected, abs=0.1)


def test_a_chessboard_on_paper_is_read(tmp_path: Path) -> None:
    tral("print", "board", "--board", "chessboard", "--columns", 8, "--rows", 6, "--out", tmp_path / "b.svg")
    board = Board(kind="chessboard", columns=8, rows=6, square=0.025)
    assert len(board.find(rasterised(tmp_path / "b.svg"))[0]) == 35


def test_a_pdf_has_the_size_of_its_paper_and_of_its_marker(tmp_path: Path) -> None:
    assert tral("print", "gate", 0, "--out", tmp_path / "gate.pdf").exit_code == 0
    pages = pdf_pages(tmp_path / "gate.pdf")
    assert len(pages) == 2
    for size, outline in pages:
        assert size == pytest.approx(PAPERS["A4"], abs=0.01)
        inside = outline[(outline > 1).all(axis=1) & (outline < np.array(size) - 1).all(axis=1)]
        lowest, highest = inside.min(axis=0), inside.max(axis=0)
        assert highest[0] - lowest[0] == pytest.approx(180.0, abs=0.01)


def test_a_pdf_is_the_same_each_time(tmp_path: Path) -> None:
    for name in ("a.pdf", "b.pdf"):
        tral("print", "board", "--out", tmp_path / name)
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()


def sheets() -> list[Sheet]:
    boards = [
        Board(),
        Board(columns=5, rows=7),
        Board(columns=3, rows=3, square=0.01, marker=0.007),
        Board(columns=3, rows=20, square=0.01, marker=0.01 * 28 / 36),
    ]
    return [*(board_sheet(board) for board in boards), marker_sheet(5), *gate_sheets(19, 200.0, "A3")]


@pytest.mark.parametrize("sheet", sheets(), ids=lambda sheet: sheet.name)
def test_every_page_has_a_ruler_of_100_mm(sheet: Sheet) -> None:
    lengths = [np.hypot(u - x, v - y) for x, y, u, v in sheet.lines]
    assert max(lengths) == pytest.approx(100.0)
    assert "100 mm" in sheet.texts[0].text


@pytest.mark.parametrize("sheet", sheets(), ids=lambda sheet: sheet.name)
def test_nothing_is_printed_into_the_white_around_the_black_or_off_the_page(sheet: Sheet) -> None:
    x, y, w, h = sheet.ink.T
    assert min(x.min(), y.min()) >= 8.0
    assert (x + w).max() <= sheet.width - 8.0
    lower = (y + h).max()
    places = [text.y - text.height for text in sheet.texts] + [min(line[1], line[3]) for line in sheet.lines[:1]]
    assert min(places) >= lower + 5.0
    assert max(text.y for text in sheet.texts) <= sheet.height - 4.0
    assert max(text.x + 0.6 * text.height * len(text.text) for text in sheet.texts) <= sheet.width


@given(st.floats(20, 254), st.sampled_from(sorted(PAPERS)))
def test_a_marker_has_half_a_cell_of_white_or_is_refused(size: float, paper: str) -> None:
    try:
        sheet = marker_sheet(1, size, paper)
    except ConfigError:
        assert size + size / 6 > PAPERS[paper][0]
        return
    assert sheet.ink[:, 0].min() >= size / 12 - 1e-9
    mounted = any("Mount on white card" in text.text for text in sheet.texts)
    assert mounted == (sheet.ink[:, 0].min() < size / 6)


@pytest.mark.parametrize("number", [1.0, 1.5, True, "1", None])
def test_a_marker_and_a_gate_have_whole_numbers(number: object) -> None:
    with pytest.raises(ConfigError, match=r"marker = .*: expected a whole number"):
        marker_sheet(number)
    with pytest.raises(ConfigError, match=r"gate = .*: expected a whole number"):
        gate_sheets(number)
    with pytest.raises(ConfigError, match=r"size_mm = '60': expected a finite number of mm"):
        marker_sheet(1, "60")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["marker", 7, "--size-mm", 200], "needs 16.6667 mm of white on either side and does not fit on A4: 180 mm"),
        (["marker", 50], "marker 50: DICT_4X4_50 has 0 to 49"),
        (["marker", 5, "--size-mm", 0.18], "size_mm = 0.18: is that metres? In millimetres it is 180"),
        (["gate", 5, "--size-mm", 0.18], "size_mm = 0.18: is that metres?"),
        (["board", "--square-mm", 0.036], "square_mm = 0.036: is that metres? In millimetres it is 36"),
        (["marker", 5, "--size-mm", -1], "size_mm = -1: expected a length above 0"),
        (["gate", 20], "gate 20: there are 0 to 19"),
        (["board", "--square-mm", 50], "is 350 x 250 mm and does not fit on A4: squares of 36.8 mm would"),
        (["board", "--square-mm", 0], "square_mm = 0: expected a length of 1 to 100000, in mm"),
        (["board", "--marker-mm", 0], "marker_mm = 0: expected a length of 1 to 100000, in mm"),
        (["board", "--square-mm", 20, "--marker-mm", 20], "expected less than the square's 0.02 m"),
        (["board", "--out", "board.png"], "unknown suffix '.png'. Allowed: .pdf, .svg"),
    ],
)
def test_what_cannot_be_printed_is_bad_usage(arguments: list[object], message: str) -> None:
    result = tral("print", *arguments)
    assert result.exit_code == 2
    assert message in result.stderr


def test_no_folder_is_made_for_what_cannot_be_written(tmp_path: Path) -> None:
    assert tral("print", "board", "--out", tmp_path / "new" / "board.png").exit_code == 2
    assert not (tmp_path / "new").exists()


def test_a_marker_that_is_asked_for_twice_is_one_svg(tmp_path: Path) -> None:
    result = tral("print", "marker", 3, 3, 4, "--out", tmp_path / "m.svg")
    assert result.stdout.count("m_3.svg") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m_3.svg", "m_4.svg"]


def test_what_is_said_to_fit_fits() -> None:
    assert board_sheet(Board(square=0.0368, marker=0.028)).width == 297.0


@pytest.mark.parametrize("suffix", ["pdf", "svg"])
def test_a_link_stays_one_and_its_file_is_written(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "store").mkdir()
    file, link = tmp_path / "store" / f"real.{suffix}", tmp_path / f"m.{suffix}"
    file.write_bytes(b"old")
    link.symlink_to(file)
    assert tral("print", "marker", 1, "--out", link).exit_code == 0
    assert link.is_symlink()
    assert file.read_bytes().startswith((b"%PDF", b"<svg", b"<?xml"))
    assert [path.name for path in file.parent.iterdir()] == [file.name]


def test_a_failed_page_leaves_the_old_file(tmp_path: Path) -> None:
    out = tmp_path / "m.pdf"
    tral("print", "marker", 1, "--out", out)
    before = out.read_bytes()
    assert tral("print", "marker", 1, "--size-mm", 500, "--out", out).exit_code == 2
    assert out.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["m.pdf"]
