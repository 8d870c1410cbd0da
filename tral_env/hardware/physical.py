"""Things that there is one of, and that cannot be copied."""

from __future__ import annotations

from typing import Any, Self


class Physical:
    """A device: its deep copy is the device itself.

    Gymnasium copies the options of an environment into its specification. A lock or an open bus cannot be copied.
    """

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """The device itself."""
        return self
