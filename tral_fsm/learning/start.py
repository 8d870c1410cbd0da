"""PPO goes on from a policy that was trained before, such as the student of a machine."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from tral_env import policy_file
from tral_env.errors import ConfigError, PolicyFileError
from tral_env.learned import Network
from tral_fsm.learning.networks import torch
from tral_fsm.policies import trained

_ACTOR = ("mlp_extractor.policy_net.", "action_net.", "log_std")
"""Begin of the names of what acts and explores."""


def network_to_begin_with(path: str) -> Network:
    """The network of a policy file, or of a packaged policy.

    Raises:
        PolicyFileError: it cannot be read.
        ConfigError: PPO cannot go on from it.
    """
    try:
        network = policy_file.load_network(trained.path_of(path))
    except PolicyFileError as error:
        raise PolicyFileError(f"--from {path}: {error}") from error
    if network.chart is not None:
        raise ConfigError(
            f"--from {path}: it follows a state chart, which the reward does not teach: train the student with --plain"
        )
    if network.correction is not None or network.output != "clip":
        raise ConfigError(
            f"--from {path}: it corrects a machine, or comes from SAC: expected a policy of --algo teacher or ppo"
        )
    return _with_plain_inputs(network)


def _with_plain_inputs(network: Network) -> Network:
    """The network whose first layer does what the normalization of its inputs did."""
    if network.normalization is None:
        return network
    mean, deviation = network.normalization
    (weight, bias), *others = network.layers
    weight = weight / deviation
    return replace(network, normalization=None, layers=[(weight, bias - weight @ mean), *others])


def digest_of_start(path: str) -> str:
    """Digest of the policy from which a training goes on, so that another one in its place is noticed."""
    return policy_file.digest(Path(trained.path_of(path)))


def begin_with(model: Any, network: Network) -> None:
    """Let the actor of a PPO model, which has as many layers, do what a network does."""
    linears = [each for each in model.policy.mlp_extractor.policy_net if isinstance(each, torch.nn.Linear)]
    with torch.no_grad():
        for linear, (weight, bias) in zip([*linears, model.policy.action_net], network.layers, strict=True):
            linear.weight.copy_(torch.from_numpy(weight))
            linear.bias.copy_(torch.from_numpy(bias))


def explore(model: Any, noise: float) -> None:
    """Let the actions of a PPO model have this standard deviation where the cars stand at first.

    With gSDE the variance is the sum of (feature * deviation)^2 over the features of the last hidden layer: what SB3
    begins with, and deviates by 1.8 with 256 features, is no more than full lock to either side.
    """
    size = 1.0
    with torch.no_grad():
        if model.use_sde:
            seen = torch.as_tensor(model.env.reset(), dtype=torch.float32)
            size = float(model.policy.mlp_extractor.forward_actor(seen).norm(dim=1).mean())
        model.policy.log_std.fill_(math.log(noise / size))


def let_actor_learn(model: Any, learns: bool) -> None:
    """Let the actor learn, or the critic alone: one that knows nothing yet would spoil the actor."""
    for name, parameter in model.policy.named_parameters():
        if name.startswith(_ACTOR):
            parameter.requires_grad_(learns)
