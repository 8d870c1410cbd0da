"""The pages of this project and the examples in them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = tuple(
    path.relative_to(ROOT).as_posix()
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/**/*.md")))
)


@dataclass(frozen=True)
class Example:
    """A fenced block of a page."""

    page: str
    line: int
    """Line of the page above its first one."""
    language: str
    text: str


def read(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def examples(page: str, text: str) -> list[Example]:
    """Every fenced block of a page, in order."""
    found = re.finditer(r"^```(\w*)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return [Example(page, text[: block.start(2)].count("\n"), block[1], block[2]) for block in found]


def commands(example: Example) -> list[str]:
    """Commands of a shell block: joined at a trailing backslash, parted at &&, without comments."""
    lines = example.text.replace("\\\n", " ").splitlines()
    bare = [re.sub(r"(^|\s)#.*", "", line) for line in lines]
    return [" ".join(command.split()) for line in bare for command in line.split("&&") if command.strip()]


def table(text: str, header: str) -> list[list[str]]:
    """Rows of the table whose header line begins so, cell by cell."""
    lines = text.split(header, 1)[1].splitlines()[2:]
    end = next((i for i, line in enumerate(lines) if not line.startswith("|")), len(lines))
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[:end]]
