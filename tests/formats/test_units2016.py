"""Files of 2016: distances in hall units, numbers in quotes."""

import json
from typing import Any

import pytest
from refused import message

from tral_fsm import MachineDefinition, load_machine
from tral_fsm.formats import read, write
from tral_fsm.formats.units2016 import HALL_UNITS

WALL = load_machine("wall")


def of_2016(**changes: Any) -> dict[str, Any]:
    drive = {"id": "0", "type": "Motor", "throttle": "0.2", "distance": "1500"}
    wall = {"id": "1", "type": "WandFolgen", "p": "12", "i": "0", "d": "30", "throttle": "0.3"}
    ways = [
        {"type": "Distance", "from": "0", "to": "1", "distance": "750"},
        {"type": "Any", "from": "1", "to": "0", "of": [{"type": "Distance", "distance": 3000}]},
    ]
    return {"units": "2016", "root": "0", "states": [drive, wall], "transitions": ways, **changes}


class TestOf2016:
    def got(self, **changes: Any) -> MachineDefinition:
        return read(json.dumps(of_2016(**changes)), "a")

    def test_distances_are_in_hall_units(self) -> None:
        machine = self.got()
        assert machine.states[0].distance == pytest.approx(1.60)  # type: ignore[attr-defined]
        assert machine.transitions[0].when.distance == pytest.approx(0.80)  # type: ignore[attr-defined]
        assert machine.transitions[1].when.of[0].distance == pytest.approx(3.20)  # type: ignore[attr-defined]
        assert HALL_UNITS == 937.5

    def test_numbers_may_stand_in_quotes(self) -> None:
        machine = self.got()
        assert (machine.root, machine.states[1].id, machine.states[1].p) == (0, 1, 12.0)  # type: ignore[attr-defined]

    @pytest.mark.parametrize("text", ["1.5e3", " 1500.0 ", "+1500"])
    def test_a_number_may_be_written_in_several_ways(self, text: str) -> None:
        drive = {"id": "0", "type": "Motor", "throttle": "0.2", "distance": text}
        assert self.got(states=[drive, of_2016()["states"][1]]).states[0].distance == pytest.approx(1.60)  # type: ignore[attr-defined]

    @pytest.mark.parametrize("text", ["1_0", "inf", "nan", "0x10", "1 0", ""])
    def test_what_python_alone_calls_a_number_is_none(self, text: str) -> None:
        drive = {"id": "0", "type": "Motor", "throttle": "0.2", "distance": text}
        assert f"got {json.dumps(text)}: expected a number" in message(json.dumps(of_2016(states=[drive])))

    def test_transitions_get_the_ids_that_they_lack(self) -> None:
        assert [way.id for way in self.got().transitions] == [0, 1]
        first = {**of_2016()["transitions"][0], "id": 1}
        assert [way.id for way in self.got(transitions=[first, of_2016()["transitions"][1]]).transitions] == [1, 0]

    def test_the_wall_follower_had_another_name(self) -> None:
        assert self.got().states[1].type == "BasicFollowWall"

    def test_nothing_is_guessed(self) -> None:
        told = message(json.dumps({key: value for key, value in of_2016().items() if key != "units"}))
        assert 'got "1500": expected a number' in told
        assert 'but in files that say "units": "2016"' in told
        assert "the key 'id' is missing" in told

    def test_units_are_si_or_2016(self) -> None:
        assert "/units: got 'hall': Allowed: SI, 2016" in message(json.dumps(of_2016(units="hall")))
        assert read(json.dumps({"units": "SI", **json.loads(write(WALL, "json"))}), "a") == WALL

    def test_a_diagram_says_it_in_its_text(self) -> None:
        text = write(read(json.dumps(of_2016()), "a"), "uxf")
        text = text.replace("<zoom_level>", "<help_text>units: 2016</help_text><zoom_level>")
        assert read(text, "a").transitions[0].when.distance == pytest.approx(0.8 / 937.5)  # type: ignore[attr-defined]
