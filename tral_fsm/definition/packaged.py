"""The machines that come with the package, by name."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable


def _folder() -> Traversable:
    return files("tral_fsm").joinpath("machines")


@cache
def names() -> tuple[str, ...]:
    """Names of the packaged machines, sorted."""
    return tuple(sorted(entry.name[:-5] for entry in _folder().iterdir() if entry.name.endswith(".json")))


def text(name: str) -> str:
    """A packaged machine as TRAL JSON."""
    return _folder().joinpath(f"{name}.json").read_text("utf-8")
