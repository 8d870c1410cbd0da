"""The car file of the tests of programs and commands: a car without sensors, whose board's clock was measured."""

from __future__ import annotations

from pathlib import Path

CAR = """
version = 1
name = "bench"
sensors = "none"

[board]
driver = "pca9685"
clock_measured = true

[pulses]
file = "tt01"
"""


def car_file(folder: Path) -> str:
    """Write it into a folder; its path."""
    path = folder / "car.toml"
    path.write_text(CAR)
    return str(path)
