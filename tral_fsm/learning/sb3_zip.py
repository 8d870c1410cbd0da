"""Zip files that models of Stable-Baselines3 (SB3) save, read without running the code that they may hold.

`policy.pth` holds the weights, which torch reads as tensors alone. `data` is JSON: beside pickles, which nobody opens
here, it shows many values as text. It may lie, so it is only asked for what would make the network another one.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tral_env.errors import ConfigError, PolicyFileError
from tral_fsm.learning.networks import torch

MAX_ZIP_MEMBER = 256 * 2**20
"""The weights in a zip have this size at most, bytes."""
MAX_DATA = 64 * 2**20
"""The JSON in a zip has this size at most, bytes; that of an off-policy model has the newest episodes in it."""
WEIGHTS, DATA = "policy.pth", "data"
_MODULES = ("stable_baselines3.common.policies", "stable_baselines3.sac.policies")
"""Modules of the policies whose weights say all of the network."""
_WITHOUT_EFFECT = frozenset(
    {
        ":type:", ":serialized:", "net_arch", "use_sde", "use_expln", "log_std_init", "full_std", "ortho_init",
        "optimizer_class", "optimizer_kwargs", "n_critics", "clip_mean", "share_features_extractor", "normalize_images",
    }
)  # fmt: skip
"""Options of a policy that change nothing of what its network answers, or that its weights tell."""
_FLATTEN = "<class 'stable_baselines3.common.torch_layers.FlattenExtractor'>"
"""The features extractor of an MlpPolicy, as the JSON shows it; it has no weights."""


@dataclass(frozen=True, kw_only=True)
class Told:
    """What the JSON tells of the network."""

    activation: str | None = None
    """Lower-case name of the activation, such as "relu"; None: it tells none, so that of SB3."""
    squash_output: bool = False
    """Whether tanh follows the last layer."""


def read_zip(path: Path) -> tuple[Mapping[str, Any], Told]:
    """Weights, and what is told of the network.

    Raises:
        PolicyFileError: the file cannot be read, or holds more than tensors where its weights should be.
        ConfigError: it tells of options that a policy of numpy has not.
    """
    try:
        if not path.is_file():
            raise PolicyFileError(f"{path}: no weights of Stable-Baselines3: there is no such file")
        with zipfile.ZipFile(path) as archive:
            weights = _member(archive, WEIGHTS, MAX_ZIP_MEMBER, path)
            data = _member(archive, DATA, MAX_DATA, path)
        _check_stored(weights, path)
        state = torch.load(io.BytesIO(weights), weights_only=True, map_location="cpu")
    except PolicyFileError:
        raise
    except Exception as error:  # whatever a file of somebody else's brings about in zipfile and torch
        said = (str(error) or type(error).__name__).splitlines()[0]
        raise PolicyFileError(f"{path}: no weights of Stable-Baselines3: {said}") from error
    if not isinstance(state, Mapping) or not all(isinstance(name, str) for name in state):
        raise PolicyFileError(f"{path}: no weights of Stable-Baselines3: got a {type(state).__name__}")
    return state, _told(data, path)


def _member(archive: zipfile.ZipFile, name: str, limit: int, path: Path) -> bytes:
    """Content of a member; zipfile reads no more than the size that it tells."""
    if archive.getinfo(name).file_size > limit:
        raise PolicyFileError(f"{path}: {name} has more than {limit} bytes")
    return archive.read(name)


def _check_stored(weights: bytes, path: Path) -> None:
    """Refuse weights that are no zip of torch, or that are packed: unpacked they could be of any size."""
    with zipfile.ZipFile(io.BytesIO(weights)) as inner:
        packed = [one.filename for one in inner.infolist() if one.compress_type != zipfile.ZIP_STORED]
        size = sum(one.file_size for one in inner.infolist())
    if packed or size > MAX_ZIP_MEMBER:
        raise PolicyFileError(f"{path}: {WEIGHTS} has packed or overlapping parts, as torch never writes them")


def _told(data: bytes, path: Path) -> Told:
    """What the JSON tells.

    Raises:
        PolicyFileError: it is no JSON.
        ConfigError: it tells of options that a policy of numpy has not.
    """
    try:
        told = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise PolicyFileError(f"{path}: {DATA} is no JSON of Stable-Baselines3: {error}") from error
    if not isinstance(told, dict):
        raise PolicyFileError(f"{path}: {DATA} is no JSON of Stable-Baselines3: expected an object")
    _check_policy_class(told, path)
    _check_space(told, path)
    if told.get("_last_original_obs") is not None:
        raise ConfigError(
            f"{path}: the model was trained behind VecNormalize, whose statistics are not in the file: train without"
        )
    return _options(told, path)


def _check_policy_class(told: Mapping[str, Any], path: Path) -> None:
    about = told.get("policy_class")
    module = about.get("__module__") if isinstance(about, dict) else None
    if module not in _MODULES:
        raise ConfigError(f"{path}: a policy of {str(module)[:80]}: expected one of {', '.join(_MODULES)}")


def _check_space(told: Mapping[str, Any], path: Path) -> None:
    """Refuse actions other than two numbers in [-1, 1]: SB3 clips or scales to the bounds that the model has."""
    space = told.get("action_space")
    space = space if isinstance(space, dict) else {}
    low, high = (_numbers(space.get(name)) for name in ("low", "high"))
    if space.get("_shape") != [2] or set(low) != {-1.0} or set(high) != {1.0}:
        raise ConfigError(
            f"{path}: action space of shape {str(space.get('_shape'))[:40]} from {str(space.get('low'))[:40]} to "
            f"{str(space.get('high'))[:40]}: expected Box(-1, 1, (2,)), as that of the environments"
        )


def _numbers(text: Any) -> list[float]:
    """Numbers of a text such as "[-1. -1.]"; none if it is another one."""
    if not isinstance(text, str) or not re.fullmatch(r"\[[-+.e\d\s]{1,200}\]", text):
        return []
    try:
        return [float(number) for number in text.strip("[]").split()]
    except ValueError:
        return []


def _options(told: Mapping[str, Any], path: Path) -> Told:
    """Options of the policy, policy_kwargs."""
    options = told.get("policy_kwargs") or {}
    if not isinstance(options, dict):
        raise PolicyFileError(f"{path}: {DATA}: policy_kwargs is no object")
    known = {"activation_fn", "squash_output", "features_extractor_class", "features_extractor_kwargs"}
    for name in options.keys() - _WITHOUT_EFFECT - known:
        raise ConfigError(f"{path}: policy_kwargs {str(name)[:40]}: a policy of numpy has no such option")
    extractor = str(options.get("features_extractor_class", _FLATTEN))
    if extractor != _FLATTEN or options.get("features_extractor_kwargs"):
        raise ConfigError(f"{path}: features extractor {extractor[:80]}: expected the FlattenExtractor of an MlpPolicy")
    if not isinstance(options.get("squash_output", False), bool):
        raise ConfigError(f"{path}: squash_output {str(options['squash_output'])[:40]}: expected true or false")
    activation = re.fullmatch(r"<class 'torch\.nn\.[\w.]*\.(\w+)'>", str(options.get("activation_fn")))
    if "activation_fn" in options and activation is None:
        raise ConfigError(f"{path}: activation_fn {str(options['activation_fn'])[:80]}: expected a class of torch.nn")
    return Told(
        activation=activation[1].lower() if activation else None, squash_output=options.get("squash_output", False)
    )
