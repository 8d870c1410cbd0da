"""What the benchmarks that drive many courses have in common: who drives, and the settings of a file of records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

ClusterAddress = Annotated[
    str | None,
    typer.Option("--cluster", metavar="ADDRESS", help="Dask scheduler whose workers drive, instead of --processes."),
]


@dataclass(frozen=True, kw_only=True)
class RunSettings:
    """One policy, one camera and one level of randomization."""

    policy: str
    camera: str
    randomization: str
