"""States and conditions of other distributions: modules that they name in the entry point group `tral_fsm.states`."""

from __future__ import annotations

from functools import cache
from importlib.metadata import EntryPoint, entry_points

from tral_env.errors import MachineError
from tral_fsm.definition.conditions import CONDITIONS
from tral_fsm.definition.machine import STATES

GROUP = "tral_fsm.states"
"""Entry point group. An entry names a module; importing the module registers its classes."""


@cache
def load_plugins() -> tuple[str, ...]:
    """Load every plugin. Only the first call does it, so that each reader of a definition may call it.

    Returns:
        What each plugin is and which types it adds, in words.

    Raises:
        MachineError: a plugin cannot be loaded; the error names its distribution.
    """
    return tuple(load(entry) for entry in entry_points(group=GROUP))


def load(entry: EntryPoint) -> str:
    """Load one plugin, and tell what it is and which types it adds.

    Raises:
        MachineError: it cannot be loaded; the error names its distribution.
    """
    try:
        entry.load()
    except Exception as error:
        raise MachineError(
            f"the plugin {entry.name!r} ({entry.value}) of the distribution {_distribution(entry)} cannot be "
            f"loaded: {type(error).__name__}: {error}. Mend or uninstall that distribution"
        ) from error
    types = [
        name
        for registry in (STATES, CONDITIONS)
        for name, spec in registry.items()
        if f"{spec.__module__}.".startswith(f"{entry.module}.")
    ]
    return f"{entry.value} of {_distribution(entry)} with {', '.join(types) or 'no type (no class has @register)'}"


def where_own_types_come_from() -> str:
    """Say, for the end of an error, how a type of another distribution becomes known, and which plugins are loaded."""
    loaded = "; ".join(load_plugins()) or "none"
    return f"A type of your own needs @register and an entry point of the group {GROUP}. Loaded plugins: {loaded}"


def _distribution(entry: EntryPoint) -> str:
    """Name and version of the distribution that an entry comes from."""
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist is not None else "(unknown)"
