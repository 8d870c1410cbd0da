"""Networks of Stable-Baselines3 as policies of numpy, from a model or from its zip file, without running its code."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tral_env.errors import ConfigError, PolicyFileError
from tral_env.learned import Network
from tral_env.learner import LearnerConfig
from tral_fsm.learning.networks import to_numpy, torch

MAX_ZIP_MEMBER = 256 * 2**20
"""The weights in a zip have this size at most, bytes."""
_KINDS = {"mlp_extractor.policy_net.": ("action_net", "clip"), "actor.latent_pi.": ("actor.mu", "tanh")}
"""Begin of the names of the hidden layers -> the last layer, and what follows it: PPO and A2C; SAC."""


def network_of(
    state: Mapping[str, Any], learner: LearnerConfig, *, activation: str, provenance: Mapping[str, Any] | None = None
) -> Network:
    """The network that acts, out of the weights of a model: ``model.policy.state_dict()``.

    Args:
        state: name -> tensor.
        learner: what it sees and does.
        activation: between its layers, one of `tral_env.learned.ACTIVATIONS`.
        provenance: where it comes from.

    Raises:
        ConfigError: these are not the weights of a PPO, A2C or SAC model with a perceptron, or they do not fit the
            learner.
    """
    for begin, (last, output) in _KINDS.items():
        if f"{last}.weight" not in state:
            continue
        hidden = sorted({int(name[len(begin) :].split(".")[0]) for name in state if name.startswith(begin)})
        names = [*(f"{begin}{index}" for index in hidden), last]
        layers = [(to_numpy(state[f"{name}.weight"]), to_numpy(state[f"{name}.bias"])) for name in names]
        return Network(
            learner=learner, layers=layers, activation=activation, output=output, provenance=dict(provenance or {})
        )
    raise ConfigError(
        f"weights {', '.join(list(state)[:4])}, ...: expected those of a PPO, A2C or SAC model with an MlpPolicy"
    )


def network_of_zip(path: str | Path, learner: LearnerConfig, *, activation: str = "tanh") -> Network:
    """The network in a zip file that a model of Stable-Baselines3 saved.

    Only the weights are read, as tensors; what else is in the file, which could run code, is left alone.

    Args:
        path: the file.
        learner: what it sees and does.
        activation: between its layers: "tanh" is the default of PPO, "relu" that of SAC.

    Raises:
        PolicyFileError: the file cannot be read, or holds more than tensors where its weights should be.
        ConfigError: see `network_of`.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            if archive.getinfo("policy.pth").file_size > MAX_ZIP_MEMBER:
                raise PolicyFileError(f"{path}: its weights have more than {MAX_ZIP_MEMBER} bytes")
            content = archive.read("policy.pth")
        state = torch.load(io.BytesIO(content), weights_only=True, map_location="cpu")
    except PolicyFileError:
        raise
    except Exception as error:  # whatever a file of somebody else's brings about in zipfile and torch
        raise PolicyFileError(f"{path}: no weights of Stable-Baselines3: {str(error).splitlines()[0]}") from error
    if not isinstance(state, Mapping):
        raise PolicyFileError(f"{path}: no weights of Stable-Baselines3: got a {type(state).__name__}")
    return network_of(state, learner, activation=activation, provenance={"file": Path(path).name})
