"""What the subcommands share: errors in words, checked names, versions."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from importlib import metadata
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperGroup

from tral_env.errors import (
    ConfigError,
    HardwareError,
    MissingExtraError,
    RenderError,
    SimulationError,
    TralError,
    nearest,
)
from tral_fsm.definition.checks import FormatError

if TYPE_CHECKING:
    from rich.table import Table

FAILED, BAD_USAGE, MACHINE_LACKS = 1, 2, 3
"""Exit codes."""

_PACKAGES = ("tral-env", "mujoco", "gymnasium", "numpy", "opencv-python-headless")


class Guarded(TyperGroup):
    """A group of commands that says an error of the project in a line on stderr instead of a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; leave with the exit code that fits at a `TralError`."""
        try:
            return super().invoke(ctx)
        except TralError as error:
            typer.secho("Error: ", err=True, fg="red", bold=True, nl=False)
            typer.echo(str(error), err=True)
            raise typer.Exit(_exit_code(error)) from None


def _exit_code(error: TralError) -> int:
    if isinstance(error, RenderError | MissingExtraError | HardwareError):
        return MACHINE_LACKS
    return FAILED if isinstance(error, SimulationError | FormatError) else BAD_USAGE


def print_figures(table: Table) -> None:
    """Print a table of figures at its full width: a figure that is cut off says nothing."""
    from rich.console import Console

    console = Console()
    full = console.measure(table, options=console.options.update(max_width=sys.maxsize)).maximum
    Console(width=max(console.width, full)).print(table)


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
