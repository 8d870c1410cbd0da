"""Mermaid and PlantUML: pictures of a machine."""

import json

import pytest

from tral_fsm.formats import read, write


class TestPictures:
    MACHINE = read(
        json.dumps(
            {
                "root": 0,
                "name": "two",
                "states": [
                    {
                        "id": 0, "type": "FSMState", "label": 'a "b"; c',
                        "machine": {"root": 0, "states": [{"id": 0, "type": "Stop"}]},
                    },
                    {"id": 1, "type": "Stop"},
                ],
                "transitions": [
                    {
                        "id": "x: y", "type": "All", "from": 0, "to": 1,
                        "of": [{"type": "Finished"}, {"type": "SensorLevel", "below": 0.5}],
                    }
                ],
            }
        ),
        "a",
    )  # fmt: skip

    def test_mermaid(self) -> None:
        assert write(self.MACHINE, "mermaid") == (
            '---\ntitle: "two"\n---\nstateDiagram-v2\n'
            '  state "a #34;b#34;#59; c" as s0\n'
            "  state s0 {\n"
            '    state "0" as s0_0\n'
            "    s0_0 : Stop\n"
            "    [*] --> s0_0\n"
            "    s0_0 --> [*]\n"
            "  }\n"
            '  state "1" as s1\n'
            "  s1 : Stop\n"
            "  [*] --> s0\n"
            "  s0 --> s1 : x#58; y#58; (Finished and SensorLevel sensor front below 0.5 m)\n"
            "  s1 --> [*]\n"
        )

    def test_plantuml(self) -> None:
        lines = write(self.MACHINE, "plantuml").splitlines()
        assert (lines[0], lines[1], lines[-1]) == ("@startuml", "title two", "@enduml")
        assert 'state "a &#34;b&#34;&#59; c" as s0 {' in lines
        assert '  state "0" as s0_0' in lines
        assert "s0 --> s1 : x: y: (Finished and SensorLevel sensor front below 0.5 m)" in lines

    @pytest.mark.parametrize(
        ("label", "coded"),
        [
            ("5 $ a\\nb", "5 <U+0024> a<U+005C>nb"),
            ("<U+0024> &#36;", "&#60;U+0024&#62; &#38;&#35;36&#59;"),
            ("my__name__", "my_&#95;name_&#95;"),
            ("--[[a]]", "-&#45;[&#91;a]&#93;"),
        ],
    )
    def test_signs_that_plantuml_would_act_on_are_codes(self, label: str, coded: str) -> None:
        machine = {"root": 0, "states": [{"id": 0, "type": "Stop", "label": label}]}
        assert f'state "{coded}" as s0' in write(read(json.dumps(machine), "a"), "plantuml").splitlines()
