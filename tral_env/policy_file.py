"""Trained policies as files that hold no code.

A policy is a folder with `policy.json`, which says what the network sees and what its answers mean, and
`policy.safetensors`, its weights.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env import json_text, tensors
from tral_env.atomic import write_bytes
from tral_env.errors import ConfigError, PolicyFileError
from tral_env.interface import CORE_FIELDS
from tral_env.learned import Chart, Correction, LearnedPolicy, Network, sizes
from tral_env.learner import LearnerConfig, LearnerView

Values = NDArray[np.float32]

FORMAT = "tral-policy"
VERSION = 1
JSON_NAME, WEIGHTS_NAME = "policy.json", "policy.safetensors"
OLD_WEIGHTS_NAME = "policy.safetensors.old"
"""Weights of the policy.json that is there, while a new policy is written."""
KEYS = ("format", "version", "observation", "learner", "network", "correction", "provenance")
MAX_JSON_BYTES = 2**20
"""A policy.json has this size at most."""


def _schema() -> list[list[Any]]:
    """What a network relies on of the readings: each field with its unit, bounds and missing value."""
    return [[each.name, each.unit, each.low, each.high, each.missing] for each in CORE_FIELDS]


def _told(learner: LearnerConfig) -> list[str]:
    """What a network sees: the columns of a frame, and those of the memory behind the frames."""
    view = LearnerView(learner, 1)
    return [*view.frame_names, *view.memory_names]


def _hash(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def save(network: Network, folder: str | Path) -> Path:
    """Write a policy.

    Args:
        network: the network.
        folder: folder of the two files; it is made if it is missing.

    Returns:
        The path of policy.json.

    Raises:
        OSError: a file cannot be written; an older policy in the folder can still be read.
        ConfigError: `load` would not read the policy: it is too large, or its provenance is no JSON.
    """
    arrays: dict[str, Values] = {}
    for index, (weight, bias) in enumerate(network.layers):
        arrays |= {f"layer{index}.weight": weight, f"layer{index}.bias": bias}
    if network.normalization is not None:
        arrays |= {"input.mean": network.normalization[0], "input.std": network.normalization[1]}
    weights = tensors.dumps(arrays)
    content = {
        "format": FORMAT,
        "version": VERSION,
        "observation": {"schema": _hash(_schema()), "fields": _schema(), "frame": _told(network.learner)},
        "learner": network.learner.record(),
        "network": {
            "sizes": [sizes(network.learner, network.chart)[0], *(len(bias) for _, bias in network.layers)],
            "activation": network.activation,
            "output": network.output,
            "normalized": network.normalization is not None,
            "weights_sha256": hashlib.sha256(weights).hexdigest(),
        },
        "correction": None if network.correction is None else asdict(network.correction),
        "chart": None if network.chart is None else asdict(network.chart),
        "provenance": dict(network.provenance),
    }
    try:
        text = (json.dumps(content, indent=2, allow_nan=False) + "\n").encode()
    except (TypeError, ValueError) as error:
        raise ConfigError(f"provenance: {error}") from error
    for name, part, limit in ((JSON_NAME, text, MAX_JSON_BYTES), (WEIGHTS_NAME, weights, tensors.MAX_BYTES)):
        if len(part) > limit:
            raise ConfigError(f"{name} would have {len(part)} bytes: expected {limit} at most")
    return _write(Path(folder), text, weights)


def _write(folder: Path, text: bytes, weights: bytes) -> Path:
    """Write both files. The older weights stay beside the new ones until the JSON that belongs to them is replaced."""
    folder.mkdir(parents=True, exist_ok=True)
    old = folder / WEIGHTS_NAME
    if old.is_file() and not _fits(folder / OLD_WEIGHTS_NAME, folder / JSON_NAME):
        write_bytes(folder / OLD_WEIGHTS_NAME, old.read_bytes())
    write_bytes(old, weights)
    write_bytes(folder / JSON_NAME, text)
    (folder / OLD_WEIGHTS_NAME).unlink(missing_ok=True)
    return folder / JSON_NAME


def digest(path: Path) -> str:
    """Digest of a policy's JSON file, which holds that of its weights.

    Args:
        path: folder of the policy, or its JSON file.

    Raises:
        OSError: it cannot be read.
    """
    return hashlib.sha256((path / JSON_NAME if path.is_dir() else path).read_bytes()).hexdigest()


def _fits(weights: Path, path: Path) -> bool:
    """Whether weights are those of a policy.json."""
    try:
        return hashlib.sha256(weights.read_bytes()).hexdigest().encode() in path.read_bytes()
    except OSError:
        return False


def is_policy_file(path: str | Path) -> bool:
    """Whether a path is a folder with a policy.json, or a file that says it is one."""
    path = Path(path)
    try:
        if path.is_dir():
            return (path / JSON_NAME).is_file()
        if path.suffix != ".json" or not path.is_file():
            return False
        with path.open("rb") as file:
            return f'"{FORMAT}"'.encode() in file.read(512)
    except (OSError, ValueError):
        return False


def load(path: str | Path) -> LearnedPolicy:
    """Read a policy.

    Args:
        path: the folder, or the policy.json in it.

    Raises:
        PolicyFileError: a file cannot be read, is damaged, was made for other readings, or it corrects a machine or
            follows a state chart, which `tral_fsm.load_policy` loads.
    """
    network = load_network(path)
    if network.correction is not None or network.chart is not None:
        does = "corrects a machine" if network.chart is None else "follows a state chart"
        raise PolicyFileError(f"{path}: it {does}: load it with tral_fsm.load_policy")
    return LearnedPolicy(network)


def load_network(path: str | Path) -> Network:
    """Read a network from its policy.json, or the folder of it, and the weights beside it.

    Raises:
        PolicyFileError: a file cannot be read, is damaged, or was made for other readings.
    """
    path = Path(path)
    path = path / JSON_NAME if path.is_dir() else path
    content = _content(path)
    _check_schema(content, path)
    try:
        learner = LearnerConfig.of(content["learner"])
    except (ConfigError, TypeError) as error:
        raise PolicyFileError(f"{path}: learner: {error}") from error
    _check_frame(content, learner, path)
    about = content["network"]
    weights = path.with_name(WEIGHTS_NAME)
    raw = _read(weights, tensors.MAX_BYTES, f": it belongs beside {path.name}")
    fits = hashlib.sha256(raw).hexdigest() == about.get("weights_sha256")
    if not fits and _fits(path.with_name(OLD_WEIGHTS_NAME), path):
        # A program was stopped between the two files.
        weights, fits = path.with_name(OLD_WEIGHTS_NAME), True
        raw = _read(weights, tensors.MAX_BYTES, "")
    arrays = tensors.loads(raw, str(weights))
    if not fits:
        raise PolicyFileError(f"{weights}: these are not the weights of {path}: copy both files together")
    try:
        return _network(learner, content, arrays)
    except KeyError as error:
        raise PolicyFileError(f"{path}: network: {error} is missing") from error
    except (ConfigError, TypeError) as error:
        raise PolicyFileError(f"{path}: network: {error}") from error


def _read(path: Path, limit: int, hint: str) -> bytes:
    """A file, which is no pipe or device."""
    try:
        if path.exists() and not path.is_file():
            raise PolicyFileError(f"{path}: cannot be read: it is no file")
        with path.open("rb") as file:
            content = file.read(limit + 1)
    except OSError as error:
        raise PolicyFileError(f"{path}: cannot be read: {error.strerror}{hint}") from error
    if len(content) > limit:
        raise PolicyFileError(f"{path}: more than {limit} bytes: it is no policy")
    return content


def _network(learner: LearnerConfig, content: Mapping[str, Any], arrays: dict[str, Values]) -> Network:
    """The network of checked files; a KeyError tells what is missing."""
    about, correction = content["network"], content["correction"]
    if not isinstance(about["sizes"], list) or not isinstance(about["normalized"], bool):
        raise ConfigError("expected sizes, a list, and normalized, true or false")
    count = len(about["sizes"]) - 1
    expected = {f"layer{index}.{part}" for index in range(count) for part in ("weight", "bias")}
    expected |= {"input.mean", "input.std"} if about["normalized"] else set()
    unused = sorted(arrays.keys() - expected)
    if unused:
        raise ConfigError(f"tensor '{unused[0][:40]}' belongs to no layer")
    layers = [(arrays[f"layer{index}.weight"], arrays[f"layer{index}.bias"]) for index in range(count)]
    chart = _chart(content.get("chart"))  # policies from before there were charts have none
    found = [sizes(learner, chart)[0], *(bias.size for _, bias in layers)]
    if found != about["sizes"]:
        raise ConfigError(f"sizes {str(about['sizes'])[:80]}: the weights have {found}")
    if correction is not None:
        if not isinstance(correction, dict):
            raise ConfigError("correction: expected null, or an object with machine, steering and speed")
        if "bounds" in correction:
            raise ConfigError("it corrects the throttle, which does nothing at a regulated speed: train it again")
        correction = Correction(**{name: correction[name] for name in ("machine", "steering", "speed")})
    return Network(
        learner=learner,
        layers=layers,
        activation=about["activation"],
        output=about["output"],
        normalization=(arrays["input.mean"], arrays["input.std"]) if about["normalized"] else None,
        correction=correction,
        chart=chart,
        provenance=content["provenance"],
    )


def _chart(told: Any) -> Chart | None:
    if told is None:
        return None
    if not isinstance(told, dict) or not all(isinstance(told.get(name), list) for name in ("states", "inputs")):
        raise ConfigError("chart: expected null, or an object with lists of states and inputs")
    return Chart(states=tuple(told["states"]), inputs=tuple(told["inputs"]))


def _content(path: Path) -> dict[str, Any]:
    raw = _read(path, MAX_JSON_BYTES, "")
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as error:
        raise PolicyFileError(f"{path}: {json_text.unread(error)}") from error
    content = json_text.loads(text, str(path), PolicyFileError)
    try:
        json.dumps(content, allow_nan=False)  # NaN and numbers such as 1e999 are no JSON that others could read
    except ValueError as error:
        raise PolicyFileError(f"{path}: no JSON: {error}") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise PolicyFileError(f'{path}: no policy: expected an object with "format": "{FORMAT}"')
    if content.get("version") != VERSION or isinstance(content["version"], bool):
        raise PolicyFileError(f"{path}: version {content.get('version')!r}: this program reads version {VERSION}")
    for key in KEYS:
        if key not in content:
            raise PolicyFileError(f"{path}: '{key}' is missing: expected {', '.join(KEYS)}")
    for key in ("observation", "learner", "network", "provenance"):
        if not isinstance(content[key], dict):
            raise PolicyFileError(f"{path}: {key}: expected an object")
    return content


def _check_schema(content: Mapping[str, Any], path: Path) -> None:
    """Refuse a policy that was made for other readings, and tell what differs."""
    about = content["observation"]
    if about.get("schema") == _hash(_schema()):
        return
    fields = about.get("fields")
    if not isinstance(fields, list) or not all(
        isinstance(each, list) and each and isinstance(each[0], str) for each in fields
    ):
        raise PolicyFileError(f"{path}: observation: expected fields, a list of lists that begin with a name")
    theirs = {each[0]: each for each in fields}
    ours = {each[0]: each for each in _schema()}
    differences = [f"it has no '{name}'" for name in ours if name not in theirs]
    differences += [f"'{name}' is unknown here" for name in theirs if name not in ours]
    differences += [
        f"'{name}' is {theirs[name][1:]} there and {mine[1:]} here (unit, lowest, highest, missing)"
        for name, mine in ours.items()
        if name in theirs and theirs[name] != mine
    ]
    if not differences:
        differences = ["the fields come in another order"]
    raise PolicyFileError(f"{path}: made for other readings: {'; '.join(differences[:10])}: train it anew")


def _check_frame(content: Mapping[str, Any], learner: LearnerConfig, path: Path) -> None:
    ours, theirs = _told(learner), content["observation"].get("frame")
    if not isinstance(theirs, list):
        raise PolicyFileError(f"{path}: observation: expected frame, a list of names")
    if theirs != ours:
        lacking = [name for name in ours if name not in theirs]
        unknown = [str(name) for name in theirs if name not in ours]
        raise PolicyFileError(
            f"{path}: made for other features: it lacks {', '.join(lacking) or 'none'}, and has beside them "
            f"{', '.join(unknown) or 'none'}, or another order: train it anew"
        )
