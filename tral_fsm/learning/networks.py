"""Perceptrons of torch, and how they become policies of numpy."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from tral_env.checks import one_of
from tral_env.errors import ConfigError, MissingExtraError
from tral_env.learned import Chart, Network
from tral_env.learner import LearnerConfig

try:
    import torch as torch  # run.py takes it from here, behind the word about the extra
    from torch import nn
except ImportError as error:
    raise MissingExtraError("torch", "rl", "tral train") from error

__all__ = ["ACTIVATIONS", "as_network", "falling", "nn", "perceptron", "to_numpy", "torch"]

ACTIVATIONS: Mapping[str, Any] = {"relu": nn.ReLU, "tanh": nn.Tanh}


def falling(share: float, last: float) -> float:
    """What is left of the first learning rate: it falls from 1 to `last` along half a cosine.

    Args:
        share: of the training that is done, in [0, 1].
        last: what is left at the end.
    """
    return last + (1.0 - last) * (1.0 + math.cos(math.pi * share)) / 2.0


def perceptron(sizes: Sequence[int], activation: str) -> nn.Sequential:
    """Linear layers with an activation between them.

    Args:
        sizes: inputs, hidden layers, outputs.
        activation: one of `ACTIVATIONS`.

    Raises:
        ConfigError: unknown activation.
    """
    one_of("activation", activation, ACTIVATIONS)
    parts: list[nn.Module] = []
    for inputs, outputs in pairwise(sizes):
        parts += [nn.Linear(inputs, outputs), ACTIVATIONS[activation]()]
    return nn.Sequential(*parts[:-1])


def as_network(
    modules: Sequence[nn.Module],
    learner: LearnerConfig,
    *,
    output: str,
    provenance: Mapping[str, Any],
    chart: Chart | None = None,
) -> Network:
    """The network of numpy that does what modules of torch do.

    Args:
        modules: linear layers with one kind of activation between them.
        learner: what it sees and does.
        output: what follows the last layer, one of `tral_env.learned.OUTPUTS`.
        provenance: where it comes from.
        chart: the state chart that it follows.

    Raises:
        ConfigError: a module is neither a linear layer nor such an activation.
    """
    layers, activations = [], set()
    for module in modules:
        if isinstance(module, nn.Linear):
            layers.append((to_numpy(module.weight), to_numpy(module.bias)))
        else:
            activations.add(type(module))
    names = [name for name, kind in ACTIVATIONS.items() if kind in activations]
    if len(activations) != len(names) or len(names) > 1:
        told = ", ".join(sorted(kind.__name__ for kind in activations))
        raise ConfigError(f"layers between {told}: expected one of {', '.join(ACTIVATIONS)}")
    return Network(
        learner=learner,
        layers=layers,
        activation=names[0] if names else "relu",
        output=output,
        chart=chart,
        provenance=provenance,
    )


def to_numpy(tensor: torch.Tensor) -> Any:
    """An array of float32 of its own."""
    return np.array(tensor.detach().cpu().numpy(), np.float32)
