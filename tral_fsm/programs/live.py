"""A drive in the browser: the car at work, and hands on it."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from tral_env.errors import MissingExtraError


@dataclass(frozen=True, kw_only=True)
class LiveArguments:
    """Where the page is served."""

    host: str = "127.0.0.1"
    port: int = 8080
    seconds: float | None = None
    """It ends by itself after so long; None: never."""


def require_viser() -> None:
    """Refuse to start where the library of the page is missing.

    Raises:
        MissingExtraError: it is.
    """
    try:
        import viser  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("viser", "live", "the page in the browser") from error


def drive(
    arguments: LiveArguments, course: dict[str, Any], drivers: Sequence[str], tell: Callable[[str], None]
) -> None:
    """Let policies drive in a page, until Ctrl-C.

    Args:
        arguments: where the page is.
        course: options of `tral_fsm.live.frame.Course`.
        drivers: names or paths of the policies, one for each car.
        tell: is told where the page is.

    Raises:
        TralError: a name is unknown, or a policy cannot drive.
    """
    require_viser()
    from tral_fsm.evaluation.contenders import built_in_names
    from tral_fsm.live.drive import LiveDrive
    from tral_fsm.live.frame import Course
    from tral_fsm.live.page import Page

    with contextlib.closing(LiveDrive(Course(**course), drivers)) as live:
        page = Page(live, host=arguments.host, port=arguments.port, drivers=built_in_names(), annotate=_annotate)
        with contextlib.closing(page), contextlib.suppress(KeyboardInterrupt):
            tell(page.url)
            live.run(arguments.seconds)


def _annotate(image: Any) -> Any:
    """Draw into a picture what is seen in it."""
    from tral_env.perception.sight import look
    from tral_fsm.report.sight import annotated

    return annotated(image, look(image))
