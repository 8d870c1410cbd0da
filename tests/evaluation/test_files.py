"""Files of results are whole, or those of before."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.figure import Figure

from tral_fsm.evaluation.files import write_figure


def test_a_figure_is_written_in_the_format_of_its_suffix(tmp_path: Path) -> None:
    figure = Figure(figsize=(1.0, 1.0))
    write_figure(tmp_path / "a.PNG", figure, 50)
    write_figure(tmp_path / "a.svg", figure, 50)
    assert (tmp_path / "a.PNG").read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in (tmp_path / "a.svg").read_bytes()


def test_a_figure_whose_drawing_is_interrupted_leaves_the_one_before(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"before")

    class Interrupted(Figure):
        def savefig(self, fname: object, **_: object) -> None:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_figure(path, Interrupted(), 50)
    assert [each.name for each in tmp_path.iterdir()] == ["a.png"]
    assert path.read_bytes() == b"before"
