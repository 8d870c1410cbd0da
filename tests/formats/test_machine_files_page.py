"""docs/machine_files.md: its files are machines, its table is that of the formats."""

import re
from pathlib import Path

import pytest

from tral_fsm.formats import FORMATS, read

PAGE = (Path(__file__).parents[2] / "docs/machine_files.md").read_text("utf-8")
FILES = re.findall(r"^```(?:json)?\n([<{].*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("text", FILES, ids=["uxf", "of 2016", "scxml"])
def test_its_files_are_machines(text: str) -> None:
    assert len(read(text, "docs/machine_files.md").states) == 2


def test_its_table_is_that_of_the_formats() -> None:
    rows = re.findall(r"^\| (\w+) \| (\..*?) \| (yes)? ?\| (yes)? ?\|", PAGE, re.MULTILINE)
    assert rows == [
        (f.name, ", ".join(f.suffixes), "yes" if f.reads else "", "yes" if f.writes else "") for f in FORMATS.values()
    ]
