"""The program of a comparison: its page with videos of failures that are driven again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from courses import blind
from films import film

from tral_fsm.evaluation.contenders import Contender, contenders
from tral_fsm.evaluation.suites import Suite
from tral_fsm.formats import write
from tral_fsm.programs.compare import PAGE, clips, compare

TINY = Suite(name="tiny", families=("straight",), levels=("none",), split="validation", courses=1)


@pytest.fixture
def field(tmp_path: Path) -> list[Contender]:
    """A machine that crashes soon."""
    (tmp_path / "circles.json").write_text(write(blind(0.9, 1.0), "json"))
    return contenders(str(tmp_path / "circles.json"))


def test_the_page_has_a_video_of_a_failure(field: list[Contender], tmp_path: Path) -> None:
    shown = compare(TINY, field, tmp_path / "out", videos=1)
    assert (tmp_path / "out" / PAGE).read_text().count('src="data:video/mp4;base64,') == 1
    made = clips(shown, TINY, field, videos=3)
    assert list(made) == [0]
    (tmp_path / "clip.mp4").write_bytes(made[0])
    assert film(tmp_path / "clip.mp4").seconds == pytest.approx(min(shown["failures"][0]["time_s"], 4.0) + 1.0, abs=0.3)


def test_a_drive_that_ends_long_before_the_failure_gives_no_video(field: list[Contender], tmp_path: Path) -> None:
    """The answers of a network differ in the last bit from batch to batch, so a drive may end earlier."""
    shown = compare(TINY, field, tmp_path / "out")
    shown["failures"][0]["time_s"] += 60.0
    assert clips(shown, TINY, field, videos=1) == {}


def test_a_text_that_no_file_can_hold_does_not_spoil_the_page(tmp_path: Path) -> None:
    """Half of a pair of characters, as a policy file may have it."""
    mine = contenders("constant")[0].agents[0]
    field = [Contender(name="mine", agents=(replace(mine, provenance={"meaning": "\ud800"}),))]
    compare(TINY, field, tmp_path / "out")
    assert "meaning: \\ud800" in (tmp_path / "out" / PAGE).read_text()
