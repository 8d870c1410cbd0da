"""A page in the browser that shows a drive at work, a recording, or a running twin."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tral_fsm.live import require_viser


@dataclass(frozen=True, kw_only=True)
class LiveArguments:
    """Where the page is served, and how long."""

    host: str = "127.0.0.1"
    port: int = 8080
    seconds: float | None = None
    """It ends by itself after so long; None: never."""


Tell = Callable[[str], None]
"""Is told the address of the page, or what a person should know."""


def drive(arguments: LiveArguments, course: dict[str, Any], drivers: Sequence[str], tell: Tell, warn: Tell) -> None:
    """Let policies drive in a page, until Ctrl-C.

    Args:
        arguments: where the page is.
        course: options of `tral_fsm.live.frame.Course`.
        drivers: names or paths of the policies, one for each car.
        tell: is told where the page is.
        warn: is told of a policy that failed, in a line.

    Raises:
        TralError: a name is unknown, or a policy cannot drive.
    """
    require_viser()
    from tral_fsm.definition import packaged
    from tral_fsm.live.drive import LiveDrive
    from tral_fsm.live.frame import Course
    from tral_fsm.live.hands import GAMEPAD, Finder, Keys
    from tral_fsm.policies import trained

    keys = Keys()
    with contextlib.ExitStack() as stack:
        find = stack.enter_context(contextlib.closing(Finder(keys)))
        live = stack.enter_context(
            contextlib.closing(LiveDrive(Course(**course), drivers, find=find, keys=keys, warn=warn))
        )
        names = [*packaged.names(), *trained.names(), GAMEPAD]
        _serve(live, arguments, tell, lambda: live.run(arguments.seconds), names)


def replay(arguments: LiveArguments, path: Path, tell: Tell) -> None:
    """Show a recording, until Ctrl-C.

    Raises:
        ConfigError: the file cannot be opened.
        BadFileError: it is no recording, or holds no tick.
    """
    require_viser()
    from tral_env.recording.read import read
    from tral_fsm.live.replay import Replay

    shown = Replay(read(path))
    _serve(shown, arguments, tell, lambda: shown.run(arguments.seconds))


def twin(arguments: LiveArguments, name: str, tell: Tell) -> None:
    """Show a running twin, until it ends or Ctrl-C.

    Raises:
        HardwareError: no twin of that name answers.
    """
    require_viser()
    from tral_env.twin.settings import runtime_folder
    from tral_fsm.live.twin import TwinView

    with contextlib.closing(TwinView(runtime_folder(name))) as shown:
        _serve(shown, arguments, tell, lambda: shown.run(arguments.seconds))


def _serve(
    source: Any, arguments: LiveArguments, tell: Tell, run: Callable[[], None], drivers: Sequence[str] = ()
) -> None:
    """Show a source while it runs."""
    from tral_fsm.live.address import LOCAL, new_token
    from tral_fsm.live.page import Page

    token = None if arguments.host in LOCAL else new_token()
    page = Page(source, host=arguments.host, port=arguments.port, token=token, drivers=drivers, annotate=_annotate)
    with contextlib.closing(page), contextlib.suppress(KeyboardInterrupt):
        tell(page.url)
        run()


def _annotate(image: Any) -> Any:
    """Draw into a picture what is seen in it."""
    from tral_env.perception.sight import look
    from tral_fsm.report.sight import annotated

    return annotated(image, look(image))
