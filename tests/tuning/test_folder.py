"""The folder of a search: no other search writes into it."""

from pathlib import Path
from typing import Any

import pytest
from courses import blind

from tral_env.errors import ConfigError
from tral_fsm.evaluation.folder import LOCK, held
from tral_fsm.tuning import Settings, Task, Tuned, tune

SETTINGS = Settings(budget=4, population=4, report_seeds=(), finalists=1, final_seeds=1)
TASK = Task(scenarios=("straight",), seeds=(0,))


def search(out: Path, **options: Any) -> Tuned:
    return tune(blind(0.5, 1.0), ["0.steering=0.3:0.9"], TASK, settings=SETTINGS, processes=1, out=out, **options)


def test_two_searches_never_write_into_one_folder(tmp_path: Path) -> None:
    with held(tmp_path), pytest.raises(ConfigError, match="another search writes into this folder: give each its own"):
        search(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [LOCK]


def test_the_caller_may_hold_the_folder_over_the_search_and_what_it_writes_after(tmp_path: Path) -> None:
    with held(tmp_path):
        search(tmp_path, is_held=True)
        with pytest.raises(ConfigError, match="another search writes into this folder"):
            search(tmp_path)


def test_a_folder_that_is_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "runs").write_text("")
    with pytest.raises(ConfigError, match=r"runs: cannot be written: .*: choose another folder"):
        search(tmp_path / "runs")
