"""The figures of the ROS page are those of the results, and its network settings those that nodes take."""

import sys
from pathlib import Path

import pytest
from pages import ROOT, read

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import ros_table

FOUND = ros_table.load(ROOT / "benchmarks" / "results" / "ros.json")


@pytest.mark.parametrize("table", ros_table.TABLES)
def test_the_tables_are_those_of_the_results(table) -> None:  # type: ignore[no-untyped-def]
    assert table(FOUND) in read("docs/ros.md")


def test_no_car_that_was_killed_moved_or_was_armed_before_somebody_armed_it() -> None:
    for each in FOUND["kill"]:
        assert not each["armed_before_it_was_armed"]
        assert each["fastest_before_mps"] < 0.01
        assert each["moves_after_arming_s"] < 3.0
