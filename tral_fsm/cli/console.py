"""Errors of the project as lines on stderr, and the exit codes of `tral`."""

from __future__ import annotations

import codecs
import errno
import io
import sys
from inspect import cleandoc
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

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
    UnreadableCarError,
    UnreadableCourseError,
)
from tral_fsm.definition.checks import FormatError
from tral_fsm.evaluation.ending import ToldToEnd, ending_cleanly, interrupted_between_imports

FAILED, BAD_USAGE, MACHINE_LACKS = 1, 2, 3
"""Exit codes: an episode failed or a file is bad, the usage is bad, the computer lacks something."""


def takes(option: str) -> type[TyperCommand]:
    """Class of a command that tells a word without an option to which one it most likely belongs.

    Args:
        option: its name, with the dashes.
    """

    class Hinting(TyperCommand):
        def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
            ctx.allow_extra_args = True
            rest = super().parse_args(ctx, args)
            if rest and not ctx.resilient_parsing:
                ctx.fail(f"Got {' '.join(rest)} without an option. Did you mean {option} {rest[0]}?")
            return rest

    return Hinting


class Guarded(TyperGroup):
    """A group of commands that prints an error of the project as a line on stderr, without a traceback."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        _flow(self)

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run the program; what the encoding of the console lacks is shown by other characters."""
        codecs.register_error(_OTHER_CHARACTERS, _other_characters)
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors=_OTHER_CHARACTERS)
        return super().main(*args, **kwargs)

    def invoke(self, ctx: Any) -> Any:
        """Run the command; at an error, a disk that takes nothing, SIGTERM or SIGHUP leave with an exit code."""
        try:
            with interrupted_between_imports(), ending_cleanly():
                return super().invoke(ctx)
        except ToldToEnd as ended:
            raise typer.Exit(ended.exit_code) from None
        except TralError as error:
            raise _told(str(error), _exit_code(error)) from None
        except OSError as error:
            if error.errno not in _DISK:
                raise
            told = f"{error.filename or 'a file'}: cannot be written: {error.strerror}: {_DISK[error.errno]}"
            raise _told(told, BAD_USAGE) from None


def _flow(command: Any) -> None:
    """Let the paragraphs of the help of a command, and of those within it, be as wide as the terminal, not as the code.

    Typer breaks all but the first paragraph where the docstring does.
    """
    if command.help is not None:
        command.help = "\n\n".join(" ".join(part.split()) for part in cleandoc(command.help).split("\n\n"))
    for each in getattr(command, "commands", {}).values():
        _flow(each)


def _told(text: str, code: int) -> typer.Exit:
    """Print an error, and give the exit with its code."""
    typer.secho("Error: ", err=True, fg="red", bold=True, nl=False)
    typer.echo(text, err=True)
    return typer.Exit(code)


_DISK = {
    errno.ENOSPC: "make room, or choose another folder",
    errno.EDQUOT: "make room, or choose another folder",
    errno.EROFS: "choose another folder",
}
"""Error number of a disk that takes nothing -> the remedy."""


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
    if isinstance(error, UnreadableCalibrationError | UnreadableCarError | UnreadableCourseError):
        return BAD_USAGE
    return FAILED if isinstance(error, _BAD_FILES) else BAD_USAGE
