"""The examples in docs/state_machine.md work."""

import re
from pathlib import Path

import pytest
from readings import Bench

from tral_env.geometry import curvature
from tral_fsm import FormatError
from tral_fsm.definition.conditions import CONDITIONS
from tral_fsm.definition.machine import STATES
from tral_fsm.formats.tral_json import loads

PAGE = (Path(__file__).parents[2] / "docs/state_machine.md").read_text("utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def test_the_python_examples_run_and_the_states_of_ones_own_drive() -> None:
    names: dict[str, object] = {"__name__": "example"}
    try:
        for block in blocks("python"):
            exec(block, names)
        machine = loads('{"root": 0, "states": [{"id": 0, "type": "Weave", "period": 1.5, "final": true}]}')
        assert machine.states[0].model_dump() == {
            "type": "Weave", "id": 0, "label": "", "final": True, "period": 1.5,
        }  # fmt: skip
        with pytest.raises(FormatError, match="/states/0/period: got 0: expected more than 0"):
            loads('{"root": 0, "states": [{"id": 0, "type": "Weave", "period": 0, "final": true}]}')
        circle = Bench({"root": 0, "states": [{"id": 0, "type": "Circle", "throttle": 0.2, "final": True}]})
        steering, throttle = circle.tick()
        assert (curvature(steering), throttle) == (pytest.approx(0.5), 0.2)
    finally:
        for name in ("Weave", "Circle"):
            STATES.unregister(name)
        CONDITIONS.unregister("FasterThan")


def test_the_json_example_is_a_machine() -> None:
    (block,) = blocks("json")
    assert len(loads(block).states) == 2


def test_every_type_has_its_row() -> None:
    for name in [*STATES, *(name for name in CONDITIONS if name not in ("All", "Any", "Not"))]:
        assert f"\n| {name} |" in PAGE


def test_every_test_that_the_page_names_is_there() -> None:
    table = PAGE[PAGE.index("## Which test holds what") :]
    files = [*Path(__file__).parents[1].rglob("test_*.py")]
    tests = {path.name: path for path in files} | {f"{path.parent.name}/{path.name}": path for path in files}
    named = re.findall(r"((?:\w+/)?test_\w+\.py)?((?:::\w+)*)(?=[;,| ])", table)
    file, count = "", 0
    for name, path in named:
        file = name or file
        if name:
            assert name in tests
        for part in [part for part in path.split("::") if part]:
            assert re.search(rf"(def|class) {part}\b", tests[file].read_text("utf-8")), part
            count += 1
    assert count > 20


def test_every_line_of_the_tables_of_2016_is_held_by_a_test() -> None:
    table = PAGE[PAGE.index("## Which test holds what") : PAGE.index("Beyond 2016:")]
    lines = re.findall(r"^\| ([^|]+) \| [^|]*test_", table, re.MULTILINE)
    words = {word for line in lines for word in re.findall(r"\w+", line.partition(":")[0])}
    of_2016 = {
        "BasicFollowWall", "FollowWall", "FollowWallRamp", "ApproachPoint", "ArucoGateCenter", "Motor", "Stop", "Idle",
        "FSMState", "Always", "Distance", "Finished", "SensorLevel", "ArucoGateFound",
    }  # fmt: skip
    assert of_2016 <= words
