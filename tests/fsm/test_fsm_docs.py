"""The examples in docs/state_machine.md work."""

import re
from pathlib import Path

from tral_fsm.definition import CONDITIONS, STATES
from tral_fsm.formats.tral_json import loads
from tral_fsm.states import RUNTIMES

PAGE = (Path(__file__).parents[2] / "docs/state_machine.md").read_text("utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def test_the_python_examples_run_and_the_state_of_ones_own_drives() -> None:
    assert len(blocks("python")) == 2
    try:
        for block in blocks("python"):
            exec(block, {"__name__": "example"})
        machine = loads('{"root": 0, "states": [{"id": 0, "type": "Weave", "period": 1.5, "final": true}]}')
        assert machine.states[0].model_dump() == {
            "type": "Weave", "id": 0, "label": "", "final": True, "period": 1.5,
        }  # fmt: skip
    finally:
        STATES.pop("Weave", None)
        RUNTIMES.pop("Weave", None)


def test_the_json_example_is_a_machine() -> None:
    (block,) = blocks("json")
    assert len(loads(block).states) == 2


def test_every_type_has_its_row() -> None:
    for name in [*STATES, *(name for name in CONDITIONS if name not in ("All", "Any", "Not"))]:
        assert f"\n| {name} |" in PAGE
