"""Names that the options of a search accept."""

from __future__ import annotations

from typing import Literal, get_args

Sampler = Literal["cmaes", "tpe", "nsga2", "random"]
"""Method of a search; all but "cmaes" are Optuna's."""
SAMPLERS: tuple[Sampler, ...] = get_args(Sampler)
Pooling = Literal["mean", "worst", "cvar"]
"""Cost of many drives: their mean, the worst of them, or the mean over the worst of them."""
POOLINGS: tuple[Pooling, ...] = get_args(Pooling)
