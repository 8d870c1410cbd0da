"""How long the nodes wait for each other before the car stops; no message types, so that a command line can be read."""

from __future__ import annotations

from tral_env.checks import check_number
from tral_env.errors import ConfigError

COMMAND_TIMEOUT_S = 0.15
"""A command may be so old, since its stamp and since it came, s."""
CAMERA_TIMEOUT_S = 0.3
"""The camera may be silent for so long, s; when its process is dead, less."""


def check_patience(name: str, value: float) -> None:
    """Check how long somebody is waited for, s.

    Raises:
        ConfigError: the car would never stop, or at once.
    """
    check_number(name, value, "s")
    if not 0.0 < value <= 10.0:
        raise ConfigError(f"{name} = {value!r}: expected a number above 0, at most 10 s")
