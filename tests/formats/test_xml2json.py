"""UMLet diagrams put through xml2json."""

import json

from diagrams import (
    ALWAYS,
    EXPECTED,
    ROOT,
    TEXTS,
    TWO,
    arrow,
    diagram,
    expected,
    problems,
    state,
)
from to_json import xml2json

from tral_fsm.formats import read


class TestJsonForm:
    def test_one_element_is_an_object(self) -> None:
        only = diagram(state("rest", TEXTS["rest"] + "\nroot: true"))
        assert isinstance(json.loads(xml2json(only))["diagram"]["element"], dict)
        assert read(xml2json(only), "a") == expected(root=1, states=EXPECTED["states"][1:], transitions=[])

    def test_none_is_no_key(self) -> None:
        assert "element" not in json.loads(xml2json(diagram()))["diagram"]
        assert problems(xml2json(diagram()))[0].startswith("diagram: 'root' is missing")

    def test_an_empty_tag_is_null_and_every_number_is_text(self) -> None:
        raw = json.loads(xml2json(diagram(TWO, ROOT, arrow(ALWAYS))))
        assert raw["diagram"]["element"][0]["additional_attributes"] is None
        assert raw["diagram"]["zoom_level"] == "10"
        assert raw["diagram"]["@program"] == "umlet"
        assert read(json.dumps(raw), "a") == expected()

    def test_a_group_that_is_nested_too_deeply_is_told_not_left_out(self) -> None:
        raw = json.loads(xml2json(diagram(TWO, ROOT, arrow(ALWAYS))))
        group = {"element": raw["diagram"].pop("element")}
        for _ in range(19):
            group = {"group": group}
        raw["diagram"]["group"] = [group, None]
        assert read(json.dumps(raw), "a") == expected()
        raw["diagram"]["group"] = {"group": group}
        assert "diagram: groups nested more than 20 deep" in problems(json.dumps(raw))[0]
        raw["diagram"]["group"] = 5
        assert "diagram: got int as a group, expected an object" in problems(json.dumps(raw))[0]

    def test_a_file_appended_to_itself_says_what_happened(self) -> None:
        once = xml2json(diagram(TWO, ROOT, arrow(ALWAYS)))
        (told,) = problems(once + once)
        assert "not JSON: Extra data" in told
        assert "two files in one? Appending (>>) to a file does that" in told
