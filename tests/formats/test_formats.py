"""Which format a file is in, and what is refused whatever it says."""

import json
import time
from pathlib import Path

import pytest
from refused import message

from tral_env.errors import MachineError
from tral_fsm import load_machine
from tral_fsm.formats import FORMATS, MAX_BYTES, by_suffix, read, write

WALL = load_machine("wall")


class TestWhichFormat:
    @pytest.mark.parametrize("name", ["json", "uxf", "scxml"])
    @pytest.mark.parametrize("suffix", [".json", ".uxf", ".scxml", ".xml", ".txt", ""])
    def test_the_content_decides(self, name: str, suffix: str, tmp_path: Path) -> None:
        path = tmp_path / f"machine{suffix}"
        path.write_text(write(WALL, name), "utf-8")
        assert load_machine(path) == WALL

    def test_the_suffix_decides_where_the_content_tells_nothing(self) -> None:
        assert "not XML: no element found" in message("", ".uxf")
        assert "not JSON: it is empty" in message("", ".json")
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
