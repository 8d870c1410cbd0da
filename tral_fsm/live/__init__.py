"""The car in the browser, at work: a drive that can be paused and changed, and the page that shows it."""

from tral_env.errors import MissingExtraError


def require_viser() -> None:
    """Refuse to go on where the library of the page is missing.

    Raises:
        MissingExtraError: it is.
    """
    try:
        import viser  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("viser", "live", "the page in the browser") from error
