"""One study, several processes: in a journal file and in PostgreSQL."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from courses import blind
from throwaway_postgres import server

from tral_env.errors import ConfigError, MissingExtraError
from tral_fsm.formats import write
from tral_fsm.tuning import Settings, Task, tune
from tral_fsm.tuning.parameters import find
from tral_fsm.tuning.search import optuna as optuna_search
from tral_fsm.tuning.search.optuna import OptunaSearch
from tral_fsm.tuning.search.space import Trial
from tral_fsm.tuning.search.storage import masked, open_storage

optuna = pytest.importorskip("optuna")

CRASHING = blind(0.5, 1.0)
"""Hits the wall within two seconds, whatever is tuned: cheap to drive."""
PARAMS = ["0.steering=0.3:0.9", "0.speed=0.8:1.6"]
TASK = Task(scenarios=("straight",), seeds=(0, 1))
SETTINGS = Settings(
    budget=4, sampler="random", population=4, report_seeds=(), finalists=1, final_seeds=1
)  # fmt: skip


@pytest.fixture(params=["journal", "postgresql"])
def storage(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """A place for a study, empty."""
    if request.param == "journal":
        yield str(tmp_path / "study.log")
        return
    with server() as url:
        yield url


def searching(storage: str, population: int = 4) -> OptunaSearch:
    return OptunaSearch(find(CRASHING, PARAMS), "random", storage=storage, population=population)


def trial(values: tuple[Any, ...], cost: float) -> Trial:
    return Trial(values=values, cost=cost, full=True, drives=1, successes=0, parts=(0, 0, 0, 0, 0))


def test_a_storage_of_another_study_is_refused(tmp_path: Path) -> None:
    storage = str(tmp_path / "study.log")
    tune(CRASHING, PARAMS, TASK, settings=SETTINGS, processes=1, storage=storage)
    with pytest.raises(ConfigError, match="the study in the storage has task"):
        tune(CRASHING, PARAMS, replace(TASK, seeds=(4,)), settings=SETTINGS, processes=1, storage=storage)


def test_what_a_dead_process_left_open_is_done_by_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    storage = str(tmp_path / "study.log")
    lost = searching(storage).ask()
    assert not set(searching(storage).ask()) & set(lost)  # it may still be at work
    monkeypatch.setattr(optuna_search, "LOST_AFTER_S", -1.0)
    assert set(lost) <= set(searching(storage, population=8).ask())


def test_who_was_taken_for_dead_and_tells_all_the_same_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    storage = str(tmp_path / "study.log")
    slow = searching(storage)
    asked = slow.ask()
    monkeypatch.setattr(optuna_search, "LOST_AFTER_S", -1.0)
    searching(storage).ask()
    slow.tell([trial(values, 1.0 + k) for k, values in enumerate(asked)])
    assert [(each.values, each.cost) for each in slow.trials] == [(values, 1.0 + k) for k, values in enumerate(asked)]


@pytest.mark.parametrize("text", ["hello\n", '{"header": {}}\n', "5\n", "\udcff\n"])
def test_a_file_that_is_no_journal_is_refused_and_stays_as_it_is(tmp_path: Path, text: str) -> None:
    path = tmp_path / "study.jsonl"
    path.write_bytes(content := text.encode(errors="surrogateescape"))
    with pytest.raises(ConfigError, match="is no journal of a study"):
        open_storage(str(path))
    assert path.read_bytes() == content


def test_a_line_that_was_cut_off_is_removed_and_said_and_nothing_else_is_lost(tmp_path: Path) -> None:
    path = tmp_path / "study.log"
    study = searching(str(path))
    asked = study.ask()
    study.tell([trial(values, 1.0 + k) for k, values in enumerate(asked)])
    whole = path.read_bytes()
    path.write_bytes(whole + whole.splitlines()[-1][:20])
    notes: list[str] = []
    open_storage(str(path), notes.append)
    assert path.read_bytes() == whole
    assert notes == [f"--storage {path}: the last line was cut off and is removed; all before it is kept."]
    again = searching(str(path))
    assert [each.cost for each in again.trials] == [1.0, 2.0, 3.0, 4.0]
    assert len(again.ask()) == 4


def test_a_process_goes_on_after_another_one_died_while_it_wrote(tmp_path: Path) -> None:
    path = tmp_path / "study.log"
    study = searching(str(path))
    asked = study.ask()
    with path.open("ab") as file:
        file.write(b'{"op_code":6,"wor')
    study.tell([trial(values, 1.0) for values in asked])
    assert len(study.trials) == len(searching(str(path)).trials) == 4


def test_a_damaged_line_of_a_journal_is_told_with_its_place_and_stays(tmp_path: Path) -> None:
    path = tmp_path / "study.log"
    searching(str(path)).ask()
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(damaged := b"".join([*lines[:2], b'{"op_code":4,"wor' + lines[2], *lines[3:]]))
    with pytest.raises(ConfigError, match=r"study.log:3: the line is damaged: mend it, or remove it and all"):
        open_storage(str(path))
    assert path.read_bytes() == damaged


def test_processes_together_do_not_exceed_the_budget_whoever_claims_first(tmp_path: Path) -> None:
    storage = str(tmp_path / "study.log")
    first, second = searching(storage), searching(storage)
    first.ask()
    second.ask()
    # The second one counts the four drives that the first one may still claim.
    assert second.claim([1, 1, 1, 1], 6) == 2
    assert first.claim([1, 1, 1, 1], 6) == 4
    assert first.claimed() == second.claimed() == 6
    second.ask()
    assert second.claim([1, 1, 1, 1], 6) == 0


def test_a_port_that_is_no_number_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"--storage postgresql://here:x/a: .*'x'"):
        open_storage("postgresql://here:x/a")


def test_any_seed_will_do(tmp_path: Path) -> None:
    for storage in (None, str(tmp_path / "study.log")):
        assert OptunaSearch(find(CRASHING, PARAMS), "tpe", seed=2**32 - 1, storage=storage).ask()
        assert OptunaSearch(find(CRASHING, PARAMS), "tpe", seed=2**40, storage=storage).ask()


def test_a_journal_in_no_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"--storage .*study.log: cannot be written: No such file or directory"):
        open_storage(str(tmp_path / "nowhere" / "study.log"))


def test_a_server_that_does_not_answer_is_told_at_once_and_without_its_password(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("psycopg")
    monkeypatch.setattr("tral_fsm.tuning.search.storage.time", None)  # it does not wait to try again
    with pytest.raises(ConfigError, match=r"--storage postgresql://me:\*\*\*@127.0.0.1:1/x: .*refused$"):
        open_storage("postgresql://me:secret@127.0.0.1:1/x")


def test_the_missing_driver_of_postgresql_is_told_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(MissingExtraError, match=r"pip install (-e )?'\.\[storage\]'"):
        open_storage("postgresql://me@127.0.0.1/x")


def test_another_missing_driver_is_named() -> None:
    with pytest.raises(ConfigError, match=r"--storage mysql://me@127\.0\.0\.1/x: No module named 'MySQLdb'"):
        open_storage("mysql://me@127.0.0.1/x")


def test_an_unknown_kind_of_database_is_named() -> None:
    with pytest.raises(ConfigError, match=r"--storage postgrsql://me:\*\*\*@there/x: .*postgrsql"):
        open_storage("postgrsql://me:secret@there/x")


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("postgresql://me:se:cret@there:5432/x", "postgresql://me:***@there:5432/x"),
        ("--storage=mysql+pymysql://:secret@there/x", "--storage=mysql+pymysql://:***@there/x"),
        ("postgresql://there/x?user=me&password=secret&a=b", "postgresql://there/x?user=me&password=***&a=b"),
        ("postgresql://me@there/x", "postgresql://me@there/x"),
        ("*.p=0.5:8", "*.p=0.5:8"),
    ],
)
def test_passwords_are_masked(said: str, shown: str) -> None:
    assert masked(said) == shown


def process(machine: Path, storage: str, budget: int, out: Path) -> subprocess.Popen[bytes]:
    arguments = [
        "tune", "--policy", machine, "--params", ",".join(PARAMS), "--seeds", "0:1", "--budget", budget,
        "--population", "4", "--sampler", "tpe", "--storage", storage, "--processes", "1", "--grid", "0",
        "--report-seeds", "none", "--out", out,
    ]  # fmt: skip
    code = "from tral_fsm.cli import app; app()"
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


@contextlib.contextmanager
def watched(storage: str) -> Iterator[Any]:
    """A function that reads what the study has been told: number of the trial -> cost."""
    place = open_storage(storage)

    def told() -> dict[int, float]:
        try:
            study = optuna.load_study(study_name="tral", storage=place)
        except KeyError:  # nobody has begun it
            return {}
        return {each.number: each.value for each in study.trials if each.value is not None}

    yield told
    if hasattr(place, "engine"):
        place.remove_session()
        place.engine.dispose()


@pytest.mark.slow
def test_one_of_two_processes_is_killed_the_other_goes_on_and_nothing_is_lost(storage: str, tmp_path: Path) -> None:
    machine = tmp_path / "crashing.json"
    machine.write_text(write(CRASHING, "json"))
    first, second = started = [process(machine, storage, 28, tmp_path / name) for name in ("one", "two")]
    with watched(storage) as told:
        try:
            while len(told()) < 4:
                with pytest.raises(subprocess.TimeoutExpired):
                    first.wait(timeout=0.2)
                assert second.poll() is None
            os.kill(first.pid, signal.SIGKILL)
            before = told()
            assert second.wait(timeout=240) == 0
            after = told()
            assert before.items() < after.items()
            report = json.loads((tmp_path / "two" / "tune.json").read_text())
            assert 28 - 4 <= report["drives"] <= 28  # less the claim of the killed one
            assert report["trials"] == len(after)
            assert "secret" not in "".join(path.read_text() for path in (tmp_path / "two").iterdir())
            # The same command with a larger budget goes on where the study is.
            started.append(process(machine, storage, 32, tmp_path / "one"))
            assert started[-1].wait(timeout=240) == 0
            assert after.items() < told().items()
            assert 32 - 4 <= json.loads((tmp_path / "one" / "tune.json").read_text())["drives"] <= 32
        finally:
            for each in started:
                if each.poll() is None:
                    each.kill()
                each.wait()
