"""A file is replaced as a whole, or not at all."""

import errno
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tral_env.atomic import is_device, whole_file, write_bytes


def names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def test_a_file_is_replaced_and_nothing_else_is_left(tmp_path: Path) -> None:
    path = tmp_path / "found.json"
    write_bytes(path, b"old, and longer")
    write_bytes(path, b"new")
    assert path.read_bytes() == b"new"
    assert names(tmp_path) == ["found.json"]


def test_two_writers_of_one_file_do_not_meet(tmp_path: Path) -> None:
    path = tmp_path / "found.json"
    contents = [bytes([letter]) * 100_000 for letter in b"ab"]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda i: write_bytes(path, contents[i % 2]), range(200)))
    assert path.read_bytes() in contents
    assert names(tmp_path) == ["found.json"]


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "file")
    write_bytes(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "file").read_bytes() == b"new"


def test_a_file_that_cannot_be_written_stays_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError, match="folder"):
        write_bytes(tmp_path / "folder", b"new")
    assert names(tmp_path) == ["folder"]


def test_a_device_is_written_to() -> None:
    assert is_device(Path(os.devnull))
    write_bytes(Path(os.devnull), b"new")
    assert is_device(Path(os.devnull))


@pytest.mark.parametrize("write", [lambda path: write_bytes(path, b"new"), lambda path: piecewise(path)])
def test_a_full_disk_is_told_with_the_file(tmp_path: Path, write: Callable[[Path], None]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "open", full)
        with pytest.raises(OSError, match="No space left on device") as caught:
            write(tmp_path / "found.json")
    assert caught.value.filename == str(tmp_path / "found.json")
    assert names(tmp_path) == []


def full(*_: object, **__: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def piecewise(path: Path) -> None:
    with whole_file(path) as stream:
        stream.write(b"new")
