"""The page docs/sensors.md keeps its word."""

from __future__ import annotations

import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "sensors.md").read_text(encoding="utf-8")


def test_its_example_runs() -> None:
    (example,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    names: dict[str, object] = {}
    exec(example, names)
    assert "reading" in names


def test_its_plots_are_there() -> None:
    plots = re.findall(r"!\[.*?\]\((.*?)\)", PAGE)
    assert len(plots) == 6
    assert [plot for plot in plots if not (DOCS / plot).is_file()] == []
