"""Errors of the project as lines on stderr, and the exit codes of `tral`."""

from __future__ import annotations

import codecs
import io
import sys
from typing import Any

import typer
from typer.core import TyperGroup

from tral_env.errors import (
    BadFileError,
    CalibrationError,
    ConfigError,
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
from tral_fsm.evaluation.ending import ToldToEnd, ending_cleanly

FAILED, BAD_USAGE, MACHINE_LACKS = 1, 2, 3
"""Exit codes: an episode failed or a file is bad, the usage is bad, the computer lacks something."""


class Guarded(TyperGroup):
    """A group of commands that prints an error of the project as a line on stderr, without a traceback."""

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run the program; what the encoding of the console lacks is shown by other characters."""
        codecs.register_error(_OTHER_CHARACTERS, _other_characters)
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors=_OTHER_CHARACTERS)
        return super().main(*args, **kwargs)

    def invoke(self, ctx: Any) -> Any:
        """Run the command; at a `TralError`, SIGTERM or SIGHUP leave with its exit code."""
        try:
            with ending_cleanly():
                return super().invoke(ctx)
        except ToldToEnd as told:
            raise typer.Exit(told.exit_code) from None
        except TralError as error:
            typer.secho("Error: ", err=True, fg="red", bold=True, nl=False)
            typer.echo(str(error), err=True)
            raise typer.Exit(_exit_code(error)) from None


_OTHER_CHARACTERS = "tral_other_characters"
_SHOWN_AS = {"\N{GREATER-THAN OR EQUAL TO}": ">=", "\N{LESS-THAN OR EQUAL TO}": "<=", "\N{HORIZONTAL ELLIPSIS}": "..."}
"""A character that Latin-1 lacks -> what stands for it; for all others a question mark does."""


def _other_characters(error: UnicodeError) -> tuple[str, int]:
    """What stands for the characters that an encoding lacks, and where to go on: see `codecs.register_error`."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return "".join(_SHOWN_AS.get(each, "?") for each in lacking), error.end


def refuse_both(context: typer.Context, one: str, other: str) -> None:
    """Refuse two options of one command of which the second would make the first do nothing.

    Args:
        context: of the command.
        one: name of an option, without the dashes.
        other: that of the second.

    Raises:
        ConfigError: both were given.
    """
    if was_given(context, one) and was_given(context, other):
        raise ConfigError(f"--{one} {context.params[one]} and --{other} {context.params[other]}: expected one of them")


def was_given(context: typer.Context, option: str) -> bool:
    """Whether an option, without its dashes, stands on the command line."""
    source = context.get_parameter_source(option)
    return source is not None and source.name == "COMMANDLINE"


_BAD_FILES = (SimulationError, BadFileError, FormatError, CourseError, PolicyError, PolicyFileError, CalibrationError)
"""A drive or a file is bad, not the command."""


def _exit_code(error: TralError) -> int:
    if isinstance(error, RenderError | MissingExtraError | HardwareError | LostWorkerError):
        return MACHINE_LACKS
    if isinstance(error, UnreadableCalibrationError | UnreadableCourseError):
        return BAD_USAGE
    return FAILED if isinstance(error, _BAD_FILES) else BAD_USAGE
