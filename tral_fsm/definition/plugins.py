"""States and conditions of other distributions: modules that they name in the entry point group `tral_fsm.states`."""

from __future__ import annotations

from functools import cache
from importlib.metadata import EntryPoint, entry_points

from tral_env.errors import MachineError

GROUP = "tral_fsm.states"
"""Entry point group. An entry names a module; importing the module registers its classes."""


@cache
def load_plugins() -> None:
    """Load every plugin. Only the first call does it, so that each reader of a definition may call it.

    Raises:
        MachineError: a plugin cannot be loaded; the error names its distribution.
    """
    for entry in entry_points(group=GROUP):
        try:
            entry.load()
        except Exception as error:
            raise MachineError(
                f"the plugin {entry.name!r} ({entry.value}) of the distribution {_distribution(entry)} cannot be "
                f"loaded: {type(error).__name__}: {error}. Mend or uninstall that distribution"
            ) from error


def _distribution(entry: EntryPoint) -> str:
    """Name and version of the distribution that an entry comes from."""
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist is not None else "(unknown)"
