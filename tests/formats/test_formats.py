"""Which format a file is in, what is refused whatever it says, and files of 2016."""

import json
import time
from pathlib import Path
from typing import Any

import pytest

from tral_env.errors import MachineError
from tral_fsm import FormatError, MachineDefinition, load_machine
from tral_fsm.formats import FORMATS, MAX_BYTES, by_suffix, read, write
from tral_fsm.formats.units2016 import HALL_UNITS

WALL = load_machine("wall")


def message(content: str | bytes, suffix: str = "") -> str:
    with pytest.raises(FormatError) as caught:
        read(content, "my.file", suffix)
    assert str(caught.value).startswith("my.file: ")
    return "\n".join(str(problem) for problem in caught.value.problems)


class TestWhichFormat:
    @pytest.mark.parametrize("name", ["json", "uxf", "scxml"])
    @pytest.mark.parametrize("suffix", [".json", ".uxf", ".scxml", ".xml", ".txt", ""])
    def test_the_content_decides(self, name: str, suffix: str, tmp_path: Path) -> None:
        path = tmp_path / f"machine{suffix}"
        path.write_text(write(WALL, name), "utf-8")
        assert load_machine(path) == WALL

    def test_the_suffix_decides_where_the_content_tells_nothing(self) -> None:
        assert "not XML: no element found" in message("", ".uxf")
        assert "not JSON: Expecting value" in message("", ".json")
        assert "not JSON: Expecting value" in message("fsm", "")

    def test_each_suffix_is_written_in_one_format(self) -> None:
        assert [by_suffix(s) for s in (".json", ".UXF", ".scxml", ".mmd", ".puml")] == [
            "json", "uxf", "scxml", "mermaid", "plantuml",
        ]  # fmt: skip
        with pytest.raises(MachineError, match=r"got suffix '.uxv': did you mean '.uxf'"):
            by_suffix(".uxv")

    def test_what_cannot_be_written(self) -> None:
        with pytest.raises(MachineError, match="got format 'mermeid': did you mean 'mermaid'"):
            write(WALL, "mermeid")
        with pytest.raises(MachineError, match="got format 'xml2json'"):
            write(WALL, "xml2json")

    def test_pictures_are_not_read(self) -> None:
        for name in ("mermaid", "plantuml"):
            assert "are written, not read" in message(write(WALL, name), FORMATS[name].suffixes[0])

    def test_other_xml_is_told(self) -> None:
        assert "got <svg> as the outermost element: expected <diagram> of UMLet" in message("<svg/>")
        assert "expected <diagram>" in message("<scxml/>")

    @pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "iso-8859-1"])
    def test_encodings(self, encoding: str) -> None:
        text = write(WALL.model_copy(update={"name": "Wände"}), "uxf").replace("UTF-8", encoding.removesuffix("-sig"))
        assert read(text.encode(encoding), "a").name == "Wände"

    def test_other_bytes_are_told(self) -> None:
        assert "not UTF-8 text: invalid start byte at byte 1" in message(b"{\xff}")
        assert "got encoding 'utf-7'" in message(b'<?xml version="1.0" encoding="utf-7"?><diagram/>')

    def test_a_folder_is_no_machine(self, tmp_path: Path) -> None:
        (tmp_path / "a.uxf").mkdir()
        with pytest.raises(MachineError, match=r"a\.uxf: cannot be read"):
            load_machine(tmp_path / "a.uxf")


LAUGHS = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 12))
BOMBS = {
    "billion laughs": f'<!DOCTYPE d [<!ENTITY l0 "ha">{LAUGHS}]><diagram><help_text>&l11;</help_text></diagram>',
    "quadratic blowup": f'<!DOCTYPE d [<!ENTITY a "{"a" * 100_000}">]><diagram>{"&a;" * 100_000}</diagram>',
    "external entity": '<!DOCTYPE d [<!ENTITY a SYSTEM "file:///etc/passwd">]><diagram><help_text>&a;</help_text></diagram>',
    "external document type": '<!DOCTYPE diagram SYSTEM "http://127.0.0.1:9/a.dtd"><diagram/>',
    "parameter entity": '<!DOCTYPE d [<!ENTITY % a SYSTEM "http://127.0.0.1:9/a"> %a;]><diagram/>',
    "after a comment": '<?xml version="1.0"?>\n<!-- a --><?b c?><!DOCTYPE d [<!ENTITY a "b">]><diagram>&a;</diagram>',
}


class TestRefused:
    @pytest.mark.parametrize("name", BOMBS)
    @pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
    def test_document_types_are_refused_at_once(self, name: str, encoding: str) -> None:
        content = BOMBS[name].encode(encoding)
        begin = time.process_time()
        assert "document type" in message(content, ".uxf")
        assert time.process_time() - begin < 0.1

    def test_unknown_entities_are_no_xml(self) -> None:
        assert "not XML: undefined entity" in message("<diagram><help_text>&a;</help_text></diagram>")

    @pytest.mark.parametrize(
        ("content", "told"),
        [
            ("{" + " " * MAX_BYTES + "}", "at most 2097152 are read"),
            ("ä" * (MAX_BYTES // 2 + 1), "got 2097154 bytes, at most 2097152 are read"),
            ("<diagram>" + "<a>" * 50_000, "XML elements nested more than 100 deep"),
            ("<diagram>" + "<a/>" * 60_000 + "</diagram>", "more than 50000 XML elements"),
            ("[" * 100_000, "nested too deeply"),
            (json.dumps({"root": 0, "states": [{"id": n, "type": "Stop"} for n in range(501)]}), "at most 500 are"),
        ],
    )
    def test_what_is_too_much(self, content: str, told: str) -> None:
        begin = time.process_time()
        assert told in message(content)
        assert time.process_time() - begin < 1.0

    def test_no_more_problems_are_told_than_can_be_read(self) -> None:
        told = message(json.dumps({"root": 0, "states": [{"id": n, "type": "Stopp"} for n in range(400)]}))
        assert told.count("\n") == 100
        assert told.endswith("there may be more than these 100 problems")

    def test_long_names_do_not_make_an_error_slow(self) -> None:
        names = [f"{n}{'ab' * 1000}" for n in range(300)]
        raw = {
            "root": 0,
            "states": [{"id": name, "type": "Stop"} for name in names],
            "transitions": [
                {"id": n, "type": "Always", "from": f"x{name}", "to": name} for n, name in enumerate(names)
            ],
        }
        begin = time.process_time()
        assert "which is no state" in message(json.dumps(raw))
        assert time.process_time() - begin < 2.0


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


class TestScxml:
    def told(self, body: str, attributes: str = "") -> str:
        return message(
            '<scxml xmlns="http://www.w3.org/2005/07/scxml" xmlns:tral="urn:tral:machine" version="1.0" '
            f"{attributes}>\n{body}\n</scxml>"
        )

    def test_the_first_state_is_the_root_unless_initial_names_one(self) -> None:
        text = write(WALL, "scxml")
        assert read(text.replace(' initial="s0"', ""), "a") == WALL
        within = "<initial><transition target='s0'/></initial><final"
        assert read(text.replace(' initial="s0"', "").replace("<final", within, 1), "a") == WALL
        assert "scxml (line 2): got 2 initial states, expected one" in message(text.replace("<final", within, 1))
        assert "/root" in message(text.replace('initial="s0"', 'initial="s9"'))

    def test_what_a_machine_has_not_is_told_with_its_line(self) -> None:
        assert "parallel 'p' (line 2): got <parallel> in it. Allowed: state, final" in self.told('<parallel id="p"/>')
        assert "onentry (line 2): got <onentry> in it" in self.told('<state id="a" tral:type="Stop"><onentry/></state>')
        assert "transition (line 2): got cond, which is not read" in self.told(
            '<state id="a" tral:type="Stop"><transition target="a" cond="x"/></state>'
        )

    def test_a_plain_state_chart_is_understood_as_far_as_its_words_go(self) -> None:
        """Events that are our types, transitions without event or id, final states, states that hold states."""
        text = """<scxml xmlns="http://www.w3.org/2005/07/scxml" xmlns:tral="urn:tral:machine" version="1.0">
          <state id="on" tral:type="Motor" tral:speed="0.5" tral:distance="1"><transition event="Finished" target="in"/>
          </state>
          <state id="in"><final id="x"/><transition target="off"/></state><final id="off"/></scxml>"""
        found = read(text, "a")
        assert [state.type for state in found.states] == ["Motor", "FSMState", "Stop"]
        assert [(way.id, way.source, way.target, way.when.type) for way in found.transitions] == [
            (0, "on", "in", "Finished"), (1, "in", "off", "Always"),
        ]  # fmt: skip
        assert found.states[2].final

    def test_charts_of_before_with_conditions_as_elements_are_read(self) -> None:
        older = """<scxml xmlns="http://www.w3.org/2005/07/scxml" xmlns:tral="urn:tral:machine" version="1.0"
            initial="s0">
          <tral:machine tral:name="two" tral:description="as before"/>
          <state id="s0" tral:id="0" tral:type="FollowWallRamp" tral:target="0.7" tral:distance="2"
              tral:speed="0.5">
            <transition event="Any" target="s1" tral:id="3" tral:type="Any">
              <tral:condition tral:type="Finished"/><tral:condition tral:type="Timer" tral:seconds="9"/>
            </transition>
          </state>
          <final id="s1" tral:id="1" tral:type="Stop"/></scxml>"""
        found = read(older, "a")
        assert (found.name, found.description, found.root) == ("two", "as before", 0)
        assert (found.states[0].id, found.states[0].target) == (0, 0.7)  # type: ignore[attr-defined]
        assert [part.type for part in found.transitions[0].when.parts] == ["Finished", "Timer"]
        assert read(write(found, "scxml"), "b") == found

    @pytest.mark.parametrize(
        ("body", "told"),
        [
            (
                '<state id="a" tral:type="Stop" brake="0.5"/>',
                "got the attribute 'brake': parameters are in a namespace",
            ),
            (
                '<state id="a" tral:type="Stop">brake: 0.5</state>',
                "state 'a' (line 2): got the text 'brake: 0.5' in it",
            ),
            (
                '<state id="a" tral:type="Stop"/><transition target="a"/>',
                "got <transition> in it. Allowed: state, final",
            ),
            ('<state id="a" tral:id="b" tral:id_="c" tral:type="Stop"/>', "got tral:id and tral:id_, expected one of"),
            (
                '<state id="a" tral:type="Stop"><transition event="Timer" tral:type="Always" target="a"/></state>',
                "got the event 'Timer', but tral:type says 'Always'",
            ),
            ('<state id="a" tral:type="Stop"/><tral:machine tral:root="b"/>', "got tral:root of a machine. Allowed:"),
            (
                '<state id="a" tral:type="Stop"><transition tral:type="Any" tral:of="[]" target="a">'
                '<tral:condition tral:type="Always"/></transition></state>',
                "got tral:of beside <tral:condition>",
            ),
        ],
    )
    def test_nothing_that_is_written_is_dropped(self, body: str, told: str) -> None:
        assert told in self.told(body)

    def test_two_targets_are_told_once(self) -> None:
        told = self.told('<state id="a" tral:type="Stop"><transition target="a b"/></state>')
        assert told == "transition (line 2): got 2 targets, expected one"

    def test_a_plain_chart_says_first_what_helps_and_then_a_line_for_each_element(self) -> None:
        body = """<state id="idle"><onentry/><onexit/><transition event="button" target="busy"/></state>
          <state id="busy"><transition event="done" target="idle"/></state>"""
        assert self.told(body).splitlines() == [
            "scxml (line 1): a plain chart: no state has a tral:type. `tral fsm states` lists the types, and "
            "`tral fsm new my.scxml` writes a machine to begin with",
            "onentry (line 2): got <onentry> in it. Allowed: transition",
            "state 'busy' (line 3) /type: got no type of state",
            'transition (line 2) /type: got "button", which is no type of transition',
            'transition (line 3) /type: got "done", which is no type of transition',
        ]

    def test_a_decimal_comma_is_guessed(self) -> None:
        told = self.told('<state id="a" tral:type="Stop" tral:brake="0,5"/>')
        assert told == "state 'a' (line 2) /brake: got \"0,5\": expected a number. A decimal comma? Write 0.5"

    def test_problems_name_element_and_line(self) -> None:
        told = self.told('<state id="a" tral:type="Stopp"/>\n<state id="b" tral:type="Stop" tral:brake="2"/>')
        assert "state 'a' (line 2) /type: got \"Stopp\"" in told
        assert "state 'b' (line 3) /brake: got 2: expected 1 or less" in told
