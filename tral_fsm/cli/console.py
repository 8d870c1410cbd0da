"""What the subcommands share: errors in words, checked names, versions."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from importlib import metadata
from typing import Any

import typer
from typer.core import TyperGroup

from tral_env.errors import ConfigError, HardwareError, MissingExtraError, RenderError, TralError, nearest

BAD_USAGE, MACHINE_LACKS = 2, 3
"""Exit codes."""

_PACKAGES = ("tral-env", "mujoco", "gymnasium", "numpy", "opencv-python-headless")


class Guarded(TyperGroup):
    """A group of commands that says an error of the project in a line on stderr instead of a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; leave with exit code 2 or 3 at a `TralError`."""
        try:
            return super().invoke(ctx)
        except TralError as error:
            typer.secho("Error: ", err=True, fg="red", bold=True, nl=False)
            typer.echo(str(error), err=True)
            lacks = isinstance(error, RenderError | MissingExtraError | HardwareError)
            raise typer.Exit(MACHINE_LACKS if lacks else BAD_USAGE) from None


def check_name(kind: str, got: str, allowed: Iterable[str]) -> str:
    """A name that must be one of some.

    Raises:
        ConfigError: it is not; the message names the nearest.
    """
    names = list(allowed)
    if got not in names:
        raise ConfigError(f"unknown {kind} '{got}': {nearest(got, names)}")
    return got


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that decide a drive."""
    python = ".".join(str(part) for part in sys.version_info[:3])
    return {"python": python, **{name: metadata.version(name) for name in _PACKAGES}}
