"""Machines by name, and files that are none."""

import json
import os
import threading
from pathlib import Path

import pytest

from tral_env.errors import MachineError
from tral_fsm import FormatError
from tral_fsm.definition import packaged
from tral_fsm.formats import library
from tral_fsm.formats.library import load


class TestPackagedMachines:
    def test_an_unknown_name_is_answered_with_the_nearest(self) -> None:
        with pytest.raises(MachineError, match=r"'offise' is no packaged machine.*did you mean 'office'"):
            load("offise")

    def test_an_unknown_inner_machine_is_answered_with_the_nearest(self, tmp_path) -> None:  # type: ignore[no-untyped-def]
        path = tmp_path / "outer.json"
        path.write_text('{"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": "wal", "final": true}]}')
        with pytest.raises(
            FormatError, match=r"/states/0/machine: got 'wal', which is no packaged machine: did you mean 'wall'"
        ):
            load(path)

    def test_a_machine_that_holds_itself_is_refused(self, monkeypatch: pytest.MonkeyPatch) -> None:
        held = '{"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": "wall", "final": true}]}'
        monkeypatch.setattr(packaged, "text", lambda name: held)
        monkeypatch.setattr(library, "by_name", library.by_name.__wrapped__)
        with pytest.raises(FormatError, match="holds itself: wall > wall"):
            load("wall")

    def test_a_pipe_is_read_once(self, tmp_path: Path) -> None:
        held = {"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": "corridor"}, {"id": 1, "type": "Stop"}],
                "transitions": [{"id": 0, "type": "Finished", "from": 0, "to": 1}]}  # fmt: skip
        pipe = tmp_path / "pipe.json"
        os.mkfifo(pipe)
        writer = threading.Thread(target=pipe.write_text, args=(json.dumps(held),), daemon=True)
        writer.start()
        with pytest.raises(FormatError, match="never says that it is finished"):
            load(pipe)
        writer.join()

    @pytest.mark.parametrize("name", ["x" * 5000, "x" * 5000 + ".json", "a\0b", "a\0b.json", ""])
    def test_what_can_be_no_name_of_a_file(self, name: str) -> None:
        with pytest.raises(MachineError):
            load(name)

    def test_a_file_that_is_not_there(self) -> None:
        with pytest.raises(MachineError, match=r"nowhere\.json: cannot be read"):
            load("nowhere.json")
