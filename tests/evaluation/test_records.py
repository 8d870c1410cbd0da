"""Lines of records: whole, cut off and damaged."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import pytest

from tral_env.errors import ConfigError
from tral_fsm.evaluation.records import Record, append, begin_run, collect, drive_missing, held, made_with, read_lines


@dataclass(frozen=True)
class Run:
    """Settings of a run."""

    policy: str = "wall"


def test_lines_come_back_in_their_order(tmp_path: Path) -> None:
    path = tmp_path / "new" / "a.jsonl"
    assert read_lines(path) == []
    append(path, {"a": 1})
    append(path, {"b": 2})
    assert path.read_text() == '{"a": 1}\n{"b": 2}\n'
    assert read_lines(path) == [{"a": 1}, {"b": 2}]


def test_a_last_line_that_was_cut_off_does_not_count_and_the_next_one_replaces_it(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    path.write_text('{"a": 1}\n{"b": ')
    assert read_lines(path) == [{"a": 1}]
    append(path, {"c": 3})
    assert path.read_text() == '{"a": 1}\n{"c": 3}\n'


def test_a_whole_last_line_without_its_end_stays(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    path.write_text('{"a": 1}')
    append(path, {"b": 2})
    assert read_lines(path) == [{"a": 1}, {"b": 2}]


@pytest.mark.parametrize("damage", ['{"b": ', "5"])
def test_a_damaged_line_before_the_last_one_is_refused(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "a.jsonl"
    path.write_text(f'{{"a": 1}}\n{damage}\n{{"c": 3}}\n')
    with pytest.raises(ConfigError, match=r"a.jsonl:2: the line is damaged"):
        read_lines(path)


def test_a_file_goes_on_with_its_settings_and_machines_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    begin_run(path, Run(), {"wall": "1f"})
    assert [line["kind"] for line in made_with(path, Run(), {"wall": "1f"})] == ["run"]
    with pytest.raises(ConfigError, match="wall changed since it was made"):
        made_with(path, Run(), {"wall": "2e"})
    with pytest.raises(ConfigError, match=r"was made with .*'wall'.*, not .*'office'"):
        made_with(path, Run(policy="office"), {"wall": "1f"})


def _twice(number: int) -> list[dict[str, int]]:
    return [{"number": number}, {"number": 10 * number}]


def test_the_lines_of_each_call_are_appended_and_counted(tmp_path: Path) -> None:
    path, counted = tmp_path / "a.jsonl", []
    collect(_twice, [(1,), (2,)], 1, path, lambda: counted.append(1))
    assert sorted(line["number"] for line in read_lines(path)) == [1, 2, 10, 20]
    assert len(counted) == 4


@pytest.mark.parametrize("line", ['{"header": {}}', '{"kind": "drive", "seed": 1}'])
def test_a_file_of_another_kind_is_refused(tmp_path: Path, line: str) -> None:
    path = tmp_path / "study.jsonl"
    path.write_text(f"{line}\n")
    with pytest.raises(ConfigError, match=r"study.jsonl:1: got no line of a run"):
        made_with(path, Run())


def _driven(family: str, seeds: Sequence[int], settings: Run) -> list[Record]:
    return [{"kind": "drive", "family": family, "seed": seed, "chunk": len(seeds)} for seed in seeds]


def test_what_a_file_lacks_is_driven_in_chunks_of_a_family(tmp_path: Path) -> None:
    path, totals, counted = tmp_path / "a.jsonl", [], []

    @contextmanager
    def bar(total: int) -> Iterator[Callable[[], None]]:
        totals.append(total)
        yield lambda: counted.append(1)

    def drive(wanted: dict[str, range]) -> list[Record]:
        drive_missing(
            wanted, _driven, lambda line: (line["family"], line["seed"]),
            out=path, settings=Run(), chunk=2, processes=1, bar=bar,
        )  # fmt: skip
        return [line for line in read_lines(path) if line["kind"] == "drive"]

    first = drive({"loop": range(3), "doors": range(1)})
    assert sorted((line["family"], line["seed"], line["chunk"]) for line in first) == [
        ("doors", 0, 1), ("loop", 0, 2), ("loop", 1, 2), ("loop", 2, 1),
    ]  # fmt: skip
    again = drive({"loop": range(4), "doors": range(1)})
    assert again[:4] == first
    assert again[4:] == [{"kind": "drive", "family": "loop", "seed": 3, "chunk": 1}]
    assert drive({"loop": range(4)}) == again
    assert (totals, len(counted)) == ([4, 1], 5)


@pytest.mark.parametrize(
    "line",
    ['{"kind": "run"}', '{"kind": "run", "settings": {}, "machines": null}', '{"kind": "run", "settings": 5}'],
)
def test_a_line_that_is_json_but_no_record_is_damaged(line: str, tmp_path: Path) -> None:
    path = tmp_path / "records.jsonl"
    path.write_text(line + "\n")
    with pytest.raises(ConfigError, match=r"records\.jsonl:1: the line is damaged"):
        made_with(path, Run())


def test_a_folder_is_no_file_of_records(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read: Is a directory"):
        read_lines(tmp_path)


@pytest.mark.parametrize("last", [b"\n", b'{"kind": "drive", "x\n', b"\xff\n", b'{"b": ' + b"1" * 200_000 + b"\n"])
def test_a_damaged_last_line_that_ends_is_replaced_too(tmp_path: Path, last: bytes) -> None:
    path = tmp_path / "a.jsonl"
    path.write_bytes(b'{"a": 1}\n' + last)
    assert read_lines(path) == [{"a": 1}]
    append(path, {"c": 3})
    assert read_lines(path) == [{"a": 1}, {"c": 3}]


def test_a_file_may_hold_more_machines_than_go_on_with_it(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    begin_run(path, Run(), {"wall": "1f", "office": "2e"})
    assert len(made_with(path, Run(), {"wall": "1f", "gate": "3d"})) == 1
    begin_run(path, Run(), {"gate": "3d"})
    for name in ("office", "gate"):
        with pytest.raises(ConfigError, match=f"{name} changed since it was made"):
            made_with(path, Run(), {"wall": "1f", name: "0"})


def test_two_runs_do_not_write_into_one_file(tmp_path: Path) -> None:
    path = tmp_path / "new" / "a.jsonl"
    with held(path):
        append(path, {"a": 1})
        with pytest.raises(ConfigError, match=r"a.jsonl: another run writes into it"):
            drive_missing(
                {"loop": range(3)}, _driven, lambda line: (line["family"], line["seed"]),
                out=path, settings=Run(), chunk=2, processes=1, bar=lambda _: nullcontext(lambda: None),
            )  # fmt: skip
    with held(path):
        assert read_lines(path) == [{"a": 1}]
