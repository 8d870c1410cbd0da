"""Nothing that drives the car asks the calendar clock: it may be set back or forth in the middle of a drive."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DRIVING = ("tral_env/hardware", "tral_env/sensors", "tral_env/perception", "tral_fsm/teleop", "tral_fsm/runtime")
FILES = [path for folder in DRIVING for path in sorted((ROOT / folder).rglob("*.py"))] + [
    ROOT / "tral_fsm" / "programs" / name for name in ("car_drive.py", "seat.py", "deploy.py", "teleop.py")
]
CALENDAR = {"time", "time_ns", "localtime", "gmtime", "ctime", "strftime", "now", "today", "utcnow", "CLOCK_REALTIME"}
"""Names by which Python's modules `time` and `datetime` tell the calendar's time."""


def asked(text: str) -> list[str]:
    """The calendar's names that are used of `time`, `datetime` or `date`."""
    found = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and node.module == "time":
            found += [name.name for name in node.names if name.name in CALENDAR]
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            is_clock = node.value.id in {"time", "datetime", "date"}
            found += [node.attr] * (is_clock and node.attr in CALENDAR)
    return found


def test_the_names_are_found() -> None:
    assert asked("import time\nnow = time.time()") == ["time"]
    assert asked("from time import time_ns") == ["time_ns"]
    assert asked("import time\nnow = time.monotonic()") == []


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_module_of_the_drive_asks_the_calendar_clock(path: Path) -> None:
    told = asked(path.read_text("utf-8"))
    is_bring_up = "bringup" in path.parts  # a calibration notes its day, and drives nothing by it
    assert told == ["today"] * (is_bring_up and "today" in told)
