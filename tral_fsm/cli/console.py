"""Errors of the project as lines on stderr, and the exit codes of `tral`."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperGroup

from tral_env.errors import (
    BadFileError,
    CalibrationError,
    CourseError,
    HardwareError,
    LostWorkerError,
    MissingExtraError,
    PolicyError,
    PolicyFileError,
    RenderError,
    SimulationError,
    TralError,
    UnreadableCalibrationError,
    UnreadableCourseError,
)
from tral_fsm.definition.checks import FormatError

FAILED, BAD_USAGE, MACHINE_LACKS = 1, 2, 3
"""Exit codes: an episode failed or a file is bad, the usage is bad, the computer lacks something."""


class Guarded(TyperGroup):
    """A group of commands that prints an error of the project as a line on stderr, without a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; at a `TralError` leave with its exit code."""
        try:
            return super().invoke(ctx)
        except TralError as error:
            typer.secho("Error: ", err=True, fg="red", bold=True, nl=False)
            typer.echo(str(error), err=True)
            raise typer.Exit(_exit_code(error)) from None


_BAD_FILES = (SimulationError, BadFileError, FormatError, CourseError, PolicyError, PolicyFileError, CalibrationError)
"""A drive or a file is bad, not the command."""


def _exit_code(error: TralError) -> int:
    if isinstance(error, RenderError | MissingExtraError | HardwareError | LostWorkerError):
        return MACHINE_LACKS
    if isinstance(error, UnreadableCalibrationError | UnreadableCourseError):
        return BAD_USAGE
    return FAILED if isinstance(error, _BAD_FILES) else BAD_USAGE
