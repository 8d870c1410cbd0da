"""UMLet diagrams: what is read from text, what from where things stand, and what is told when it does not fit."""

import json
import re
from pathlib import Path

import pytest
from diagrams import (
    ALWAYS,
    EXPECTED,
    ROOT,
    STATES,
    TEXTS,
    TWO,
    arrow,
    diagram,
    element,
    expected,
    problems,
    state,
    tag,
)
from to_json import xml2json

from tral_fsm import FormatError, load_machine
from tral_fsm.formats import read, write


class TestText:
    def test_parameters_stand_between_rules_and_below_the_arrow(self) -> None:
        assert (
            read(diagram(TWO, ROOT, arrow('lt=->\n"id": 0,\n"type": "Always",\n"from": 0, "to": 1,')), "a")
            == expected()
        )

    def test_parameters_may_be_bare(self) -> None:
        go = state("go", "id: 0\ntype: Motor, throttle: 0.2\nlabel: straight on, slowly")
        got = read(diagram(go, state("rest"), ROOT, arrow(ALWAYS + "from: 0\nto: 1")), "a")
        assert got == expected(
            states=[{**EXPECTED["states"][0], "label": "straight on, slowly"}, EXPECTED["states"][1]]
        )

    def test_a_value_may_run_over_lines(self) -> None:
        combined = (
            'lt=->\nid: 0\n"type": "Any",\n"of": [\n  {"type": "Always"},\n  {"type": "Finished"}\n]\nfrom: 0\nto: 1'
        )
        go = state("go", TEXTS["go"] + "\ndistance: 1")
        got = read(diagram(go, state("rest"), ROOT, arrow(combined)), "a")
        assert [part.type for part in got.transitions[0].when.of] == ["Always", "Finished"]  # type: ignore[attr-defined]

    def test_without_an_id_the_title_is_the_id(self) -> None:
        got = read(diagram(state("go", "type: Motor\nthrottle: 0.2"), state("rest"), ROOT, arrow(ALWAYS)), "a")
        assert (got.root, got.states[0].id, got.transitions[0].source) == ("go", "go", "go")

    def test_notes_and_how_things_are_drawn_say_nothing(self) -> None:
        note = element("UMLNote", (600, 0, 100, 60), '"id": 7,\n"type": "Stop"')
        dashes = arrow("lt=..", "10;10;210;10", (390, 20, 220, 20))
        got = read(diagram(TWO, ROOT, note, dashes, arrow("lt=->\nfg=red\nlw=2\n// a comment: 3\n" + ALWAYS[5:])), "a")
        assert got == expected()

    def test_name_and_description_stand_in_the_text_of_the_diagram(self) -> None:
        text = "// Uncomment to change the font\nfontsize=14\n// name: two\ndescription: goes, then stops"
        got = read(diagram(TWO, ROOT, arrow(ALWAYS), text=text), "a")
        assert got == expected(name="two", description="goes, then stops")

    def test_control_characters_are_blanks(self) -> None:
        text = xml2json(diagram(TWO, ROOT, arrow(ALWAYS))).replace("id: 0", "\\tid:\\u0001 0\\r")
        assert read(text, "a") == expected()


class TestNothingIsDropped:
    """What a person wrote is read or told, wherever it stands."""

    def test_parameters_behind_a_second_rule_are_read(self) -> None:
        go = element("UMLState", STATES["go"], 'go\n--\nid: 0\ntype: Motor\n--\nthrottle: 0.2\nbg=red\n--\nlabel: "on"')
        got = read(diagram(go, state("rest"), ROOT, arrow(ALWAYS)), "a")
        assert got == expected(states=[{**EXPECTED["states"][0], "label": "on"}, EXPECTED["states"][1]])

    def test_a_parameter_on_both_sides_of_a_rule_is_told(self) -> None:
        go = element("UMLState", STATES["go"], f"go\n--\n{TEXTS['go']}\n--\nthrottle: 7.5")
        assert "UMLState 'go' (element 1): got 'throttle' twice, again in line 7 of its text" in problems(
            diagram(go, state("rest"), ROOT, arrow(ALWAYS))
        )

    def test_other_words_behind_a_second_rule_are_told(self) -> None:
        go = element("UMLState", STATES["go"], f"go\n--\n{TEXTS['go']}\n--\nslow down")
        assert "got 'slow down' in line 7 of its text" in problems(diagram(go))[0]

    @pytest.mark.parametrize(
        "line", ["lt=-> id: 0, type: Always", "lt=->   id: 0\ntype: Always", "lt=->\nlw=2 id: 0\ntype: Always"]
    )
    def test_what_stands_behind_a_setting_is_read(self, line: str) -> None:
        assert read(diagram(TWO, ROOT, arrow(line)), "a") == expected()

    def test_words_behind_a_setting_are_told(self) -> None:
        told = problems(diagram(TWO, ROOT, arrow("lt=-> always\n" + ALWAYS[5:])))
        assert told == ["Relation '0' (element 5): got 'always' in line 1 of its text, expected: name: value"]

    def test_a_comment_behind_a_setting_is_one(self) -> None:
        assert read(diagram(TWO, ROOT, arrow("lt=-> // dashed?\n" + ALWAYS[5:])), "a") == expected()

    def test_a_type_with_an_equals_sign_is_told(self) -> None:
        go = state("go", "id: 0\ntype=Motor")
        assert "got 'type=Motor' in line 4 of its text, expected: name: value" in problems(diagram(go))[0]

    def test_other_words_in_the_text_of_the_diagram_are_told(self) -> None:
        told = problems(diagram(TWO, ROOT, arrow(ALWAYS), text="// a comment\nfontfamily=Serif //or another\nroot: 0"))
        assert told == [
            "diagram: got 'root: 0' in line 3 of its text. Allowed: name, description, units, comments (//)"
        ]

    def test_a_tag_that_comes_twice_is_told(self) -> None:
        go = state("go").replace("</element>", "<panel_attributes>p: 7</panel_attributes></element>")
        assert "element 1: got <panel_attributes> twice" in problems(diagram(go))

    def test_a_second_diagram_in_the_json_form_is_told(self) -> None:
        once = json.loads(xml2json(diagram(TWO, ROOT, arrow(ALWAYS))))
        assert "got 'states' beside 'diagram', expected one diagram" in problems(json.dumps({**once, "states": []}))[0]


class TestRoot:
    def test_a_state_may_say_that_it_is_the_root(self) -> None:
        assert (
            read(diagram(state("go", TEXTS["go"] + ',\n"root": true'), state("rest"), arrow(ALWAYS)), "a") == expected()
        )

    def test_no_root_and_two_roots_are_told(self) -> None:
        assert "diagram: 'root' is missing, let an initial node" in problems(diagram(TWO, arrow(ALWAYS)))[0]
        twice = state("rest", TEXTS["rest"] + ',\n"root": true')
        assert "diagram: got 2 roots: 1, 0" in problems(diagram(state("go"), twice, ROOT, arrow(ALWAYS)))[0]

    def test_an_arrow_to_a_final_node_makes_a_state_final(self) -> None:
        end = element("UMLSpecialState", (40, 150, 20, 20), "type=final")
        to_end = arrow("lt=->", "10;10;10;100", (40, 50, 20, 120))
        got = read(diagram(state("go"), ROOT, end, to_end), "a")
        assert got == expected(states=[{**EXPECTED["states"][0], "final": True}], transitions=[])


class TestWhere:
    @pytest.mark.parametrize("line", ["lt=->", "lt=->>", "lt=.>", "lt=<-"])
    def test_ends_are_where_they_are_drawn(self, line: str) -> None:
        points = "210;10;110;30;10;10" if line == "lt=<-" else "10;10;110;30;210;10"
        assert read(diagram(TWO, ROOT, arrow(line + ALWAYS[5:], points)), "a") == expected()

    @pytest.mark.parametrize(("off", "sticks"), [(9, True), (-9, True), (10, False), (-10, False)])
    def test_an_end_sticks_within_9_pixels_of_an_outline(self, off: int, sticks: bool) -> None:
        text = diagram(TWO, ROOT, arrow(ALWAYS, f"{10 + off};10;210;10"))
        if sticks:
            assert read(text, "a") == expected()
        else:
            assert problems(text) == [
                "Relation '0' (element 5): 'from' is missing, and that end touches no outline of a state"
            ]

    @pytest.mark.parametrize("zoom", [5, 7, 10, 20])
    def test_points_of_new_files_are_not_zoomed(self, zoom: int) -> None:
        def zoomed(found: re.Match[str]) -> str:
            return f"<{found[1]}>{int(found[2]) * zoom / 10}</{found[1]}>"

        text = re.sub(r"<([xywh])>(-?\d+)</[xywh]>", zoomed, diagram(TWO, ROOT, arrow(ALWAYS), zoom=zoom))
        assert read(text, "a") == expected()

    @pytest.mark.parametrize("zoom", [5, 10, 20])
    def test_legacy_files(self, zoom: int) -> None:
        def box(*sides: int) -> tuple[float, ...]:
            return tuple(side * zoom / 10 for side in sides)

        def points(*values: int) -> str:
            return ";".join(f"{value * zoom / 10:g}" for value in values)

        elements = [
            element("custom.State", box(*STATES["go"]), f"go\n--\n{TEXTS['go']}\n--", legacy=True),
            element("custom.State", box(*STATES["rest"]), f"rest\n--\n{TEXTS['rest']}\n--", legacy=True),
            element("custom.InitialState", box(-60, 20, 20, 20), legacy=True),
            element("base.Relation", box(-50, 20, 60, 20), "lt=<-", points(50, 10, 10, 10), legacy=True),
            element("base.Relation", box(90, 20, 220, 20), ALWAYS, points(10, 10, 210, 10), legacy=True),
            element("base.Note", box(500, 500, 9, 9), "a note", legacy=True),
        ]
        text = f"<umlet_diagram>{tag('zoom_level', zoom)}<group>{''.join(elements[:2])}</group>{''.join(elements[2:])}"
        assert read(f"{text}</umlet_diagram>", "a") == expected()

    def test_an_end_that_is_drawn_elsewhere_than_its_text_says_is_told(self) -> None:
        told = problems(diagram(TWO, ROOT, arrow(ALWAYS + "from: 1\nto: 1")))
        assert told[0] == (
            "Relation '0' (element 5): says 'from': 1, but that end is drawn at UMLState 'go' (element 1)"
        )

    def test_explicit_ends_need_no_place(self) -> None:
        assert read(diagram(TWO, ROOT, arrow(ALWAYS + "from: 0\nto: 1", "10;90;50;90")), "a") == expected()
        assert read(diagram(TWO, ROOT, arrow(ALWAYS[5:] + "from: 0\nto: 1")), "a") == expected()

    def test_a_line_without_a_head_is_told(self) -> None:
        assert problems(diagram(TWO, ROOT, arrow("lt=-" + ALWAYS[5:]))) == [
            f"Relation '0' (element 5): '{end}' is missing, and a line without a head (lt=->) does not tell it"
            for end in ("from", "to")
        ]

    def test_order_is_that_of_the_file_unless_arrows_say_otherwise(self) -> None:
        def order(*orders: int | None) -> list[int | str]:
            ways = [
                arrow(f"lt=->\nid: {index}\ntype: Timer\nseconds: {index + 1}\n" + (f"order: {o}" if o else ""))
                for index, o in enumerate(orders)
            ]
            return [way.id for way in read(diagram(TWO, ROOT, *ways), "a").transitions]

        assert order(None, None, None) == [0, 1, 2]
        assert order(3, 1, 2) == [1, 2, 0]
        assert order(None, 2, 1) == [2, 1, 0]


class TestPlainCharts:
    """State charts that were drawn without the palette."""

    def test_what_helps_comes_first_then_a_line_for_each_element(self) -> None:
        idle = element("UMLState", STATES["go"], "Idle\n--\nentry / beep\nexit / stop beeping")
        busy = element("UMLState", STATES["rest"], "Busy")
        told = problems(diagram(idle, busy, ROOT, arrow("lt=->\nbutton [on] / light\nr1=once")))
        assert told == [
            "diagram: a plain chart: no state has a `type:`. Drag states and transitions from the palette "
            "(TRAL_State-Machine.uxf), or begin with `tral fsm new my.uxf`",
            "UMLState 'Idle' (element 1): got 'entry / beep' in line 3 of its text, expected: name: value",
            "UMLState 'Busy' (element 2): got no parameters: they stand below a line --",
            "Relation 'Idle' > 'Busy' (element 5): got 'button [on] / light' in line 2 of its text, "
            "expected: name: value",
        ]

    def test_a_state_within_a_state_is_named(self) -> None:
        outer = element("UMLState", (0, 0, 500, 300), "Running")
        inner = element("UMLState", (50, 50, 100, 60), "Fast")
        assert problems(diagram(outer, inner))[0].endswith(
            "States within states are not read ('Fast' in 'Running'): an FSMState holds a machine"
        )

    def test_a_large_one_says_it_too(self) -> None:
        many = [element("UMLState", (200 * n, 0, 100, 60), f"s{n}\n--\ndo / a\ndo / b\ndo / c") for n in range(60)]
        told = problems(diagram(*many))
        assert "a plain chart" in told[0]

    def test_a_chart_with_a_type_is_told_in_full(self) -> None:
        told = problems(diagram(state("go"), element("UMLState", STATES["rest"], "Busy"), ROOT, arrow(ALWAYS)))
        assert "a plain chart" not in told[0]


class TestIds:
    def test_a_transition_needs_no_id(self) -> None:
        assert read(diagram(TWO, ROOT, arrow("lt=->\ntype: Always")), "a") == expected()

    def test_further_copies_from_the_palette_are_numbered(self) -> None:
        motor = "id: Motor\ntype: Motor\nspeed: 0.5\ndistance: 1"
        first, second = state("go", motor), state("rest", motor)
        first, second = first.replace("go\n", "Motor\n", 1), second.replace("rest\n", "Motor\n", 1)
        ways = [
            arrow("lt=->\nid: Finished\ntype: Finished"),
            arrow("lt=->\nid: Finished\ntype: Finished", "210;10;10;10", (90, 40, 220, 20)),
        ]
        got = read(diagram(first, second, ROOT, *ways), "a")
        assert [part.id for part in got.states] == ["Motor", "Motor 2"]
        assert [(way.id, way.source, way.target) for way in got.transitions] == [
            ("Finished", "Motor", "Motor 2"),
            (0, "Motor 2", "Motor"),
        ]

    def test_a_copy_with_a_title_of_its_own_has_it_as_its_id(self) -> None:
        stop = "id: Stop\ntype: Stop"
        got = read(diagram(state("go", stop), state("rest", stop + "\nroot: true"), arrow("lt=<-\ntype: Always")), "a")
        assert [part.id for part in got.states] == ["Stop", "rest"]
        assert got.root == "rest"

    def test_an_id_of_your_own_that_repeats_is_told(self) -> None:
        told = problems(
            diagram(state("go", "id: a\ntype: Stop"), state("rest", "id: a\ntype: Stop"), ROOT, arrow(ALWAYS))
        )
        assert "got id 'a', which UMLState 'go' (element 1) has already" in told[0]


class TestTold:
    @pytest.mark.parametrize(
        "line", ["cbase=0.2", "cpos=4,-10", "c=see here", "m1pos=5,5", "m2pos=5,5", "r1pos=5,5", "r2pos=5,5"]
    )
    def test_where_umlet_puts_a_label_says_nothing(self, line: str) -> None:
        assert read(diagram(TWO, ROOT, arrow(f"lt=->\n{line}\n{ALWAYS[6:]}")), "a") == expected()

    def test_a_decimal_comma_is_guessed(self) -> None:
        told = problems(diagram(state("go", "id: 0\ntype: Motor\nthrottle: 0,2\nfinal: true"), ROOT))
        assert told == [
            "UMLState 'go' (element 1): 'throttle': got 0,2 in line 5 of its text: a decimal comma? Then write 0.2, or "
            "several values in brackets"
        ]

    @pytest.mark.parametrize(
        ("elements", "message"),
        [
            ([state("go", "id: 0\ntype: Moter")], "UMLState 'go' (element 1) /type: got \"Moter\", which is no type"),
            (
                [state("go", "id: 0\np 12")],
                "UMLState 'go' (element 1): got 'p 12' in line 4 of its text, expected: name",
            ),
            (
                [state("go", 'id: 0\n"label": "ab')],
                "UMLState 'go' (element 1): 'label' is no JSON: Unterminated string",
            ),
            ([state("go", "id: 0\nid: 1")], "UMLState 'go' (element 1): got 'id' twice, again in line 4 of its text"),
            ([state("go", TEXTS["go"] + "\np = 3")], "UMLState 'go' (element 1): got 'p = 3' in line 6"),
            ([element("UMLState", (0, 0, 9, 9), "go")], "UMLState 'go' (element 1): got no parameters"),
            ([element("UMLClass", (0, 0, 9, 9), "go")], "element 1: got 'UMLClass'. Allowed: UMLState, Relation"),
            ([element("UMLSpecialState", (0, 0, 9, 9), "type=decision")], "got 'UMLSpecialState type=decision'"),
            ([TWO, arrow(ALWAYS + "order: first")], "Relation '0' (element 3): got order: 'first', expected a number"),
            ([TWO, state("rest")], "UMLState 'rest' (element 3) /id: got id 1, which UMLState 'rest' (element 2) has"),
            ([TWO, ROOT, arrow("lt=->\nid: 2")], "Relation '2' (element 5) /type: got no type of transition"),
            ([TWO, arrow("lt=->")], "Relation 'go' > 'rest' (element 3) /type: got no type of transition"),
        ],
    )
    def test_each_problem_names_its_element(self, elements: list[str], message: str) -> None:
        assert any(message in problem for problem in problems(diagram(*elements)))

    def test_problems_within_an_inline_machine_name_the_state_around_it(self) -> None:
        inner = {"root": 0, "states": [{"id": 0, "type": "Stop"}, {"id": 0, "type": "Stop"}]}
        told = problems(diagram(state("go", f"id: 0\ntype: FSMState\nmachine: {json.dumps(inner)}"), ROOT))
        assert "UMLState 'go' (element 1) /machine/states/1/id: got id 0, which /states/0 has already" in told

    def test_an_unknown_inner_machine_names_the_state_that_holds_it(self, tmp_path: Path) -> None:
        path = tmp_path / "my.uxf"
        path.write_text(diagram(state("go", "id: 0\ntype: FSMState\nmachine: wal\nfinal: true"), ROOT), "utf-8")
        with pytest.raises(FormatError, match=r"my\.uxf: 1 problem\n  UMLState 'go' \(element 1\) /machine: got 'wal'"):
            load_machine(path)

    def test_an_empty_diagram(self) -> None:
        assert problems(diagram())[0].startswith("diagram: 'root' is missing")


def test_what_is_written_is_a_diagram_of_today() -> None:
    text = write(expected(), "uxf")
    assert text.count("<id>UMLState</id>") == 2
    assert text.count("<id>Relation</id>") == 2
    assert "<zoom_level>10</zoom_level>" in text
    assert "lt=-&gt;" in text


def test_written_arrows_stick_without_their_text() -> None:
    several = [{**EXPECTED["transitions"][0], "id": n, "type": "Timer", "seconds": n + 1} for n in range(3)]
    machine = expected(transitions=several)
    text = re.sub(r'"(from|to)": \d,\n', "", write(machine, "uxf"))
    assert '"from"' not in text
    assert read(text, "a") == machine
