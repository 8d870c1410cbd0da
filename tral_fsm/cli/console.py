"""What the subcommands share: errors in words, checked names, versions."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

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
from tral_fsm.bench.host import versions
from tral_fsm.definition.checks import FormatError
from tral_fsm.evaluation.results import print_figures

__all__ = ["BAD_USAGE", "FAILED", "MACHINE_LACKS", "Guarded", "check_name", "print_figures", "versions"]

FAILED, BAD_USAGE, MACHINE_LACKS = 1, 2, 3
"""Exit codes."""


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


def check_name(kind: str, got: str, allowed: Iterable[str]) -> str:
    """A name that must be one of some.

    Raises:
        ConfigError: it is not; the message names the nearest.
    """
    names = list(allowed)
    if got not in names:
        raise ConfigError(f"unknown {kind} '{got}': {nearest(got, names)}")
    return got
