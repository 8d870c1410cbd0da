"""The parameters of a machine for a reader: all that a search may change, and those that it changes by default."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tral_env.errors import ConfigError
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.definition.validated import type_name
from tral_fsm.tuning.parameters import Parameter, Site, Value, searchable, sites

_GAINS = ("p", "i", "d")
_SPEED = "speed"


@dataclass(frozen=True, kw_only=True)
class Listed:
    """A parameter of a machine that a search may change."""

    site: Site
    path: str
    name: str
    """The path with labels instead of ids."""
    where: str
    """Type of its state or condition."""
    value: Value
    unit: str
    parameter: Parameter | None
    """Its range; None: a range must be given."""
    is_default: bool
    """Whether a search without `--params` changes it."""


def listing(machine: MachineDefinition) -> list[Listed]:
    """All that a search may change in a machine, in the order of the file; not what is null."""
    default = {site.path for site in _defaults(machine)}
    found = []
    for site in sites(machine):
        parameter = searchable(site)
        if site.value is None or (parameter is None and not isinstance(site.value, float)):
            continue
        found.append(
            Listed(
                site=site,
                path=site.path,
                name=site.names[-1],
                where=type_name(site.spec),
                value=site.value,
                unit=site.unit,
                parameter=parameter,
                is_default=site.path in default,
            )
        )
    return found


def default_patterns(machine: MachineDefinition) -> list[str]:
    """Paths of the gains of a machine's states (p, i, d); of a machine without gains the speeds of its states.

    Raises:
        ConfigError: it has neither.
    """
    found = [site.path for site in _defaults(machine)]
    if not found:
        raise ConfigError("the machine has neither gains nor speeds: name parameters (--params, --list-params)")
    return found


def _defaults(machine: MachineDefinition) -> Sequence[Site]:
    usable = [
        site
        for site in sites(machine)
        if isinstance(site.value, float) and site.value and not site.path.rpartition("/")[2].startswith("transition")
    ]
    return [site for site in usable if site.name in _GAINS] or [site for site in usable if site.name == _SPEED]
