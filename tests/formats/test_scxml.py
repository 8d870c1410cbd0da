"""State charts of the W3C: what is read, and what is refused."""

import pytest
from refused import message

from tral_fsm import load_machine
from tral_fsm.formats import read, write

WALL = load_machine("wall")


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
