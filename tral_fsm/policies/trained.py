"""The trained policies that come with the package, by name."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from tral_env import policy_file

_FOLDER = Path(str(files("tral_fsm").joinpath("trained")))


@cache
def names() -> tuple[str, ...]:
    """Names of the packaged policies, sorted."""
    entries = _FOLDER.iterdir() if _FOLDER.is_dir() else ()
    return tuple(sorted(entry.name for entry in entries if policy_file.is_policy_file(entry)))


def path_of(name_or_path: str | Path) -> str | Path:
    """The folder of a packaged policy; any other name or path as it is."""
    return _FOLDER / name_or_path if str(name_or_path) in names() else name_or_path
