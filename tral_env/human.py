"""A page for `render_mode="human"`, which another package brings: this one draws nothing on a screen."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any, Protocol

from tral_env.errors import ConfigError
from tral_env.installation import installed

GROUP = "tral_env.human"
"""Group of entry points: each is a function without arguments that gives a `HumanView`."""


class HumanView(Protocol):
    """Shows a drive to a person while an environment steps it."""

    def show(self, world: Any) -> None:
        """Show the first car of a `World` after a reset or a step, and wait for its time to come."""
        ...

    def close(self) -> None:
        """Show nothing any more."""
        ...


def open_human_view() -> HumanView:
    """The view of the first package that brings one.

    Raises:
        ConfigError: none does.
        MissingExtraError: it lacks a library.
    """
    for entry in entry_points(group=GROUP):
        view: HumanView = entry.load()()
        return view
    raise ConfigError(
        f"render_mode='human': no installed package has an entry point of the group '{GROUP}': install this one again "
        f"({installed().command()}), or take render_mode='rgb_array'"
    )
