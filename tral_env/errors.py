"""The tree of errors. Every message says what was got, where, and what is allowed."""

from __future__ import annotations

import difflib
import traceback
from collections.abc import Iterable, Sequence
from pathlib import Path


class TralError(Exception):
    """Base of every error this project raises on purpose."""


class ConfigError(TralError, ValueError):
    """A value of a configuration, an option or an argument is not allowed."""


class BadFileError(ConfigError):
    """A file that was given can be opened, but something in it is not allowed, or it is damaged."""


class UnreadableCarError(BadFileError):
    """A car file cannot be opened: the command is wrong, not the file."""


class UnknownOptionError(ConfigError, TypeError):
    """An environment does not take an option of this name. Python, too, has a TypeError for unknown arguments."""


class CourseError(TralError, ValueError):
    """A course file cannot be read, or the course that it describes cannot be built or driven."""


class UnreadableCourseError(CourseError):
    """A course file cannot be opened."""


class MachineError(TralError, ValueError):
    """A machine file cannot be read, or the machine that it describes cannot run."""


class PolicyError(TralError, RuntimeError):
    """A policy failed while it drove: its code raised an error, or its answer is no command."""

    why = ""
    """The reason alone, without the policy's name and the time; empty: the whole message is the reason."""


class PolicyFileError(TralError, ValueError):
    """A policy file cannot be read, or was made for other readings."""


class MachineRunError(PolicyError, MachineError):
    """A state or a condition of a machine failed while the machine drove."""


class CalibrationError(TralError, ValueError):
    """A calibration file of a car or a camera cannot be used."""


class UnreadableCalibrationError(CalibrationError):
    """A file of a lens or of a calibration cannot be opened: the command is wrong, not the file."""


class SimulationError(TralError, RuntimeError):
    """The physics of a car became unstable."""


class LostWorkerError(TralError, RuntimeError):
    """A process that drove for another one ended before its work did."""


class RenderError(TralError, RuntimeError):
    """An image cannot be rendered on this machine."""


class HardwareError(TralError, OSError):
    """A device of the real car does not answer, or answers nonsense."""


class ActuatorLostError(HardwareError):
    """The actuator's process is gone, and its keeper ends the pulses; only a car that is opened anew drives again."""


class CarStoppedError(HardwareError):
    """A fault of the car was noticed, and it was stopped; only a reset arms it again."""


class SourceLostError(HardwareError):
    """The device in a person's hands is gone: the car stops, and nobody else takes over."""


class MissingExtraError(TralError, ImportError):
    """An optional package is not installed."""

    def __init__(self, package: str, extra: str, purpose: str) -> None:
        self.missing = (package, extra, purpose)
        from tral_env.installation import installed  # the actuator's process imports this file, and needs no more

        super().__init__(
            f"{purpose} needs the package '{package}', which is not installed: {installed().command(extra)}"
        )


_MAX_NAMES = 60
"""`nearest` looks at so many names and tells them: a file with thousands must not make an error slow."""
_MAX_LETTERS = 40
"""`nearest` looks at so many letters of a name and tells them."""


def nearest(got: object, allowed: Iterable[object]) -> str:
    """Say which names are allowed and which of them is nearest to the one that was asked for.

    Args:
        got: the name that was asked for.
        allowed: the names that are allowed.

    Returns:
        A clause for the end of an error message, such as ``did you mean 'corners'? Allowed: corners, doors``.
    """
    names = [str(name)[:_MAX_LETTERS] for name in allowed]
    match = difflib.get_close_matches(str(got)[:_MAX_LETTERS], names[:_MAX_NAMES], n=1)
    hint = f"did you mean '{match[0]}'? " if match else ""
    more = f", ... ({len(names)} in all)" if len(names) > _MAX_NAMES else ""
    return f"{hint}Allowed: {', '.join(names[:_MAX_NAMES])}{more}"


def problem_list(head: str, problems: Iterable[object]) -> str:
    """Word an error that tells several problems at once: a head, then each problem in a line of its own."""
    return "\n  ".join([head, *map(str, problems)])


def problem_report(source: str, problems: Sequence[object]) -> str:
    """Word an error that tells all that is wrong with a source: a file, a course, a machine.

    Args:
        source: what the problems are of.
        problems: each is told by its text.

    Returns:
        A text such as ``my.json: 2 problems``, and a line below it for each problem.
    """
    count = "1 problem" if len(problems) == 1 else f"{len(problems)} problems"
    return problem_list(f"{source}: {count}", problems)


_MAX_REASON = 300
"""`reason` tells so many letters of an error."""


def reason(error: BaseException, file: str | None = None) -> str:
    """Word an error of code that is not ours in a line, with its place.

    Args:
        error: what was raised.
        file: path of the code that is to blame; None: wherever the error was raised.

    Returns:
        A clause such as ``ZeroDivisionError: division by zero (weave.py, line 12)``.
    """
    lines = str(error).strip().splitlines()
    told = f"{type(error).__name__}: {lines[0][:_MAX_REASON]}" if lines else type(error).__name__
    if isinstance(error, SyntaxError):  # it tells its place itself
        return told
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if frame.filename == file] or frames
    return f"{told} ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else told
