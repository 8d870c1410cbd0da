"""Networks of Stable-Baselines3 (SB3) as policies of numpy, from a model or from its zip file, of which no code runs.

What the policy of numpy cannot do exactly as the model does is refused, not approximated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tral_env import tensors
from tral_env.errors import ConfigError, nearest
from tral_env.learned import MAX_LAYERS, Network, Values
from tral_env.learner import LearnerConfig
from tral_fsm.learning.networks import ACTIVATIONS, torch
from tral_fsm.learning.sb3_zip import read_zip

EXPECTED = "expected those of a PPO, A2C or SAC model with an MlpPolicy"


@dataclass(frozen=True, kw_only=True)
class _Kind:
    """Where a kind of model keeps the network that acts."""

    hidden: str
    """Begin of the names of its hidden layers."""
    last: str
    """Its last layer."""
    output: str
    """What follows it, one of `tral_env.learned.OUTPUTS`."""
    deviation: tuple[str, ...]
    """Names that models with a continuous action have: one of them is there."""
    activation: str
    """What SB3 puts between its layers by default."""


_ON_POLICY = _Kind(
    hidden="mlp_extractor.policy_net.",
    last="action_net",
    output="clip",
    deviation=("log_std",),
    activation="tanh",
)
"""PPO and A2C."""
_SAC = _Kind(
    hidden="actor.latent_pi.",
    last="actor.mu",
    output="tanh",
    deviation=("actor.log_std.weight", "actor.log_std"),
    activation="relu",
)
_REFUSED = {
    "mlp_extractor.shared_net.": "layers that actor and critic share",
    "features_extractor.": "a features extractor with weights",
    "pi_features_extractor.": "a features extractor with weights",
    "actor.features_extractor.": "a features extractor with weights",
    "actor.mu.0.": "a mean that is clipped (SAC with use_sde, TD3, DDPG)",
    "lstm_actor.": "a recurrent network",
}
"""Begin of a name -> what it belongs to, which a policy of numpy does not do."""


def network_of_model(model: Any, learner: LearnerConfig, *, provenance: Mapping[str, Any] | None = None) -> Network:
    """The network that acts in a model of SB3.

    Args:
        model: a PPO, A2C or SAC.
        learner: what it sees and does: the options of the environment in which it was trained.
        provenance: where it comes from.

    Raises:
        ConfigError: the model does what a policy of numpy would not do, such as normalizing its observations, or does
            not fit the learner.
    """
    policy = model.policy
    _check_actions(type(model.action_space).__name__, model.action_space)
    extractor = policy.features_extractor_class.__name__
    if extractor != "FlattenExtractor":
        raise ConfigError(f"features extractor {extractor}: expected the FlattenExtractor of an MlpPolicy")
    names = [name for name, kind in ACTIVATIONS.items() if kind is policy.activation_fn]
    if not names:
        raise ConfigError(f"activation_fn {policy.activation_fn.__name__}: expected one of {', '.join(ACTIVATIONS)}")
    squashed = policy.squash_output if "action_net.weight" in policy.state_dict() else True
    found = network_of(policy.state_dict(), learner, activation=names[0], squash_output=squashed, provenance=provenance)
    return replace(found, normalization=_normalization(model.get_vec_normalize_env()))


def _normalization(normalizer: Any) -> tuple[Values, Values] | None:
    """Mean and deviation by which `VecNormalize` divides; None: it leaves observations as they are.

    Raises:
        ConfigError: it clips them, too.
    """
    if normalizer is None or not normalizer.norm_obs:
        return None
    if np.isfinite(normalizer.clip_obs):
        raise ConfigError(
            f"the model was trained behind VecNormalize with clip_obs={normalizer.clip_obs:g}, and a policy file does "
            "not clip: expected VecNormalize(..., clip_obs=math.inf), or norm_obs=False"
        )
    mean, var = normalizer.obs_rms.mean, normalizer.obs_rms.var
    return mean.astype(np.float32), np.sqrt(var + normalizer.epsilon).astype(np.float32)


def _check_actions(kind: str, space: Any) -> None:
    """Refuse actions other than two numbers in [-1, 1]."""
    if kind != "Box" or space.shape != (2,) or not (np.all(space.low == -1.0) and np.all(space.high == 1.0)):
        raise ConfigError(f"action space {space}: expected Box(-1, 1, (2,)), as that of the environments")


def network_of(
    state: Mapping[str, Any],
    learner: LearnerConfig,
    *,
    activation: str,
    squash_output: bool = False,
    provenance: Mapping[str, Any] | None = None,
) -> Network:
    """The network that acts, out of the weights of a model: ``model.policy.state_dict()``.

    The weights tell neither activation nor bounds nor VecNormalize. `network_of_model` looks after all of them.

    Args:
        state: name -> tensor.
        learner: what it sees and does.
        activation: between its layers, one of `tral_env.learned.ACTIVATIONS`.
        squash_output: whether a PPO or A2C has this option, which is tanh behind the last layer; SAC always has it.
        provenance: where it comes from.

    Raises:
        ConfigError: these are not the weights of a PPO, A2C or SAC model with a perceptron, or they do not fit the
            learner.
    """
    kind = _kind(state)
    layers = [_layer(state, name) for name in _names(state, kind)]
    return Network(
        learner=learner,
        layers=layers,
        activation=activation,
        output="tanh" if squash_output else kind.output,
        provenance=dict(provenance or {}),
    )


def _kind(state: Mapping[str, Any]) -> _Kind:
    """The kind of model that has these weights.

    Raises:
        ConfigError: none that can be exported.
    """
    names = [str(name) for name in state]
    for begin, what in _REFUSED.items():
        if any(name.startswith(begin) for name in names):
            raise ConfigError(f"weights {begin}*: {what}: {EXPECTED}")
    for kind in (_ON_POLICY, _SAC):
        if f"{kind.last}.weight" in state:
            if not any(name in state for name in kind.deviation):
                raise ConfigError(f"weights without {kind.deviation[0]}: the model chooses among actions: {EXPECTED}")
            return kind
    raise ConfigError(f"weights {', '.join(names[:4])[:120]}, ...: {EXPECTED}")


def _names(state: Mapping[str, Any], kind: _Kind) -> list[str]:
    """Names of the layers, in their order; SB3 counts linear layers 0, 2, 4 with an activation between them.

    Raises:
        ConfigError: other layers lie between them, or there are too many.
    """
    own = {str(name)[len(kind.hidden) :].split(".")[0] for name in state if str(name).startswith(kind.hidden)}
    expected = [str(2 * k) for k in range(len(own))]
    if own != set(expected):
        raise ConfigError(
            f"hidden layers {', '.join(sorted(own))[:80]}: expected linear layers 0, 2, 4 ... with activations without "
            "weights between them"
        )
    if len(own) >= MAX_LAYERS:
        raise ConfigError(f"{len(own) + 1} layers: expected 1 to {MAX_LAYERS}")
    return [*(f"{kind.hidden}{number}" for number in expected), kind.last]


def _layer(state: Mapping[str, Any], name: str) -> tuple[Values, Values]:
    return _array(state, f"{name}.weight", 2), _array(state, f"{name}.bias", 1)


def _array(state: Mapping[str, Any], name: str, dimensions: int) -> Values:
    """A tensor as float32; one of float64 is rounded.

    Raises:
        ConfigError: it is missing, or no dense tensor of floating numbers that a policy file can hold.
    """
    tensor = state.get(name)
    if not isinstance(tensor, torch.Tensor):
        got = "nothing" if tensor is None else type(tensor).__name__
        raise ConfigError(f"weights {name}: got {got}, expected a tensor")
    if tensor.layout != torch.strided or not tensor.is_floating_point() or tensor.is_meta:
        raise ConfigError(f"weights {name}: got a tensor of {tensor.dtype}, {tensor.layout}: expected floating numbers")
    if tensor.dim() != dimensions or 4 * tensor.numel() > tensors.MAX_BYTES:
        raise ConfigError(
            f"weights {name} have the shape {tuple(tensor.shape)}: expected {dimensions} dimensions, and "
            f"{tensors.MAX_BYTES} bytes at most"
        )
    return np.array(tensor.detach().to("cpu", torch.float32).numpy(), np.float32)


def network_of_zip(path: str | Path, learner: LearnerConfig, *, activation: str | None = None) -> Network:
    """The network in a zip file that a model of SB3 saved.

    Only tensors and plain JSON are read; what else is in the file, which could run code, is left alone. The file does
    not tell whether a PPO was trained behind VecNormalize: one that was gives wrong answers.

    Args:
        path: the file.
        learner: what it sees and does.
        activation: between its layers; None: as the file tells.

    Raises:
        PolicyFileError: the file cannot be read, or holds more than tensors where its weights should be.
        ConfigError: see `network_of`, or the file tells of options that a policy of numpy has not.
    """
    state, told = read_zip(Path(path))
    kind = _kind(state)
    found = told.activation or kind.activation
    if found not in ACTIVATIONS:
        raise ConfigError(f"{path}: activation_fn {found}: expected one of {', '.join(ACTIVATIONS)}")
    if activation is not None and activation != found:
        if activation not in ACTIVATIONS:
            raise ConfigError(f"unknown activation '{activation}': {nearest(activation, ACTIVATIONS)}")
        raise ConfigError(f"{path}: the file tells of the activation {found}, got {activation}")
    squashed = told.squash_output or kind is _SAC
    provenance = {"file": Path(path).name}
    return network_of(state, learner, activation=found, squash_output=squashed, provenance=provenance)
