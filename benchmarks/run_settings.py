"""What all drives of a file of records have in common."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class RunSettings:
    """One policy, one camera and one level of randomization."""

    policy: str
    camera: str
    randomization: str
