"""A training as it goes: its time, its curve, its best network, and the files from which it goes on."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from tral_env import policy_file
from tral_env.atomic import write_bytes
from tral_env.errors import ConfigError
from tral_env.learned import Network
from tral_fsm.evaluation.files import prepare_folder, write_json
from tral_fsm.evaluation.folder import held, set_aside
from tral_fsm.evaluation.host import host
from tral_fsm.evaluation.seeds import stretches
from tral_fsm.formats import library, tral_json
from tral_fsm.learning.choices import TRAINING_SEEDS, TrainRequest
from tral_fsm.learning.networks import torch
from tral_fsm.learning.start import digest_of_start
from tral_fsm.learning.validation import ENOUGH, Score, Validation
from tral_fsm.policies.of_network import policy_of

REQUEST, CURVE, PICTURE, CHECKPOINT = "train.json", "curve.json", "curve.png", "checkpoint.pt"
_FILES = (REQUEST, CURVE, PICTURE, CHECKPOINT, policy_file.JSON_NAME, policy_file.WEIGHTS_NAME)
RECENT = 200
"""Success in the training is that of so many episodes."""
MIN_PAUSE_S = 20.0
"""Time between two validations, s, at the least."""
MAX_POINTS = 500
"""A policy file tells so many points of its curve at most; curve.json has all."""
PAUSES = 6.0
"""The time between two validations is so many times as long as the last one took: they take a seventh of the time."""


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a training is."""

    share: float
    """Of the time or the steps, in [0, 1]."""
    seconds: float
    steps: int
    """Decisions of all cars together."""
    success: float | None
    """Of the latest episodes of the training; None before the first."""
    best: Score | None
    """Best validation so far."""


class Curve:
    """Points of a training, and the summary of its file."""

    def __init__(self, points: list[dict[str, Any]]) -> None:
        self.points = points

    @property
    def seconds(self) -> float:
        """Time of the last point, s."""
        return float(self.points[-1]["seconds"]) if self.points else 0.0

    @property
    def steps(self) -> int:
        """Decisions of the last point."""
        return int(self.points[-1]["steps"]) if self.points else 0

    @property
    def validation_s(self) -> float:
        """Time that the validation of the last point took, s; 0 before the first."""
        return float(self.points[-1].get("validation_s", 0.0)) if self.points else 0.0


class TrainingRun:
    """Files and clock of a training. Use it as a context; the clock runs within."""

    def __init__(
        self,
        request: TrainRequest,
        settings: Any,
        folder: Path,
        *,
        resume: bool = False,
        on_progress: Callable[[Progress], None] | None = None,
    ) -> None:
        """Check all that is asked for; the files of an earlier training stay until the first validation.

        Args:
            request: what is asked for.
            settings: the dataclass of the algorithm's hyper-parameters.
            folder: folder of the files.
            resume: go on with the training in the folder.
            on_progress: called a few times a second.

        Raises:
            ConfigError: the folder cannot be written, or has no training that this one can go on with, or a value is
                not allowed.
            MachineError: there is no such machine, or it cannot run.
        """
        self.request, self.settings, self.folder = request, settings, folder
        self._on_progress, self._resumed = on_progress, resume
        prepare_folder(folder)
        self._asked = {"request": request.record(), "settings": _plain(asdict(settings)), "machine": _machine(request)}
        self._start = {} if request.start is None else {"start_sha256": digest_of_start(request.start)}
        points: list[dict[str, Any]] = []
        self._state: dict[str, Any] | None = None
        if resume:
            points, self._state = _resumed(folder, self._asked)
        self._opened = False
        self._held = contextlib.ExitStack()
        self.aside: Path | None = None
        """Folder of the files of an earlier training, which were set aside; None: there were none."""
        self.curve = Curve(points)
        self._enough = wanted_arrivals(points, request.algo)
        self.best: Score | None = _best(points, self._enough)
        self.steps = self.curve.steps
        self._before_s = self.curve.seconds
        self._began = time.monotonic()
        self._validated_s, self._cost_s = self.seconds, self.curve.validation_s
        self._seeds = request.validation_seeds
        self.validation = Validation(request.scenarios, self._seeds, request.levels, request.nthread)

    def __enter__(self) -> TrainingRun:
        try:
            self._held.enter_context(held(self.folder, "training"))
        except ConfigError:
            self.validation.close()
            raise
        self._began = time.monotonic()
        return self

    def __exit__(self, *_: object) -> None:
        self.validation.close()
        self._held.close()

    def _open(self) -> None:
        """Begin to write: set the files of an earlier training aside, unless this one goes on with it."""
        if self._opened:
            return
        self._opened = True
        if not self._resumed:
            self.aside = set_aside(self.folder, _FILES)
        write_json(self.folder / REQUEST, self._asked | {"host": host()})

    def keep(self, state: Mapping[str, Any]) -> None:
        """Write what the algorithm needs to go on: tensors, numbers, and mappings and lists of them."""
        self._open()
        content = io.BytesIO()
        torch.save({"points": len(self.curve.points), "state": dict(state)}, content)
        write_bytes(self.folder / CHECKPOINT, content.getvalue())

    def kept(self) -> dict[str, Any] | None:
        """What `keep` wrote, if this training goes on with an earlier one; else None."""
        return self._state

    @property
    def seconds(self) -> float:
        """Time of the training so far, those that it goes on with included, s."""
        return self._before_s + time.monotonic() - self._began

    @property
    def share(self) -> float:
        """Of the training that is done, in [0, 1]; the time of the last validation belongs to it."""
        if self.request.steps is not None:
            return min(self.steps / self.request.steps, 1.0)
        assert self.request.minutes is not None
        return min((self.seconds + self._cost_s) / (60.0 * self.request.minutes), 1.0)

    @property
    def is_over(self) -> bool:
        """Whether time or steps are used up."""
        return self.share >= 1.0

    def tell(self, success: float | None) -> None:
        """Tell how far the training is."""
        if self._on_progress is not None:
            self._on_progress(
                Progress(share=self.share, seconds=self.seconds, steps=self.steps, success=success, best=self.best)
            )

    @property
    def is_validation_due(self) -> bool:
        """Whether it is time to look at the network."""
        return self.seconds - self._validated_s > max(MIN_PAUSE_S, PAUSES * self._cost_s)

    def validate(self, network: Network, figures: Mapping[str, Any]) -> Score:
        """Drive the validation, keep the network if it is the best so far, and write the curve.

        Args:
            network: the network.
            figures: what the training tells of itself: success, episodes, loss.
        """
        self._open()
        began = time.monotonic()
        score = self.validation.score(policy_of(network))
        self._cost_s = time.monotonic() - began
        self._validated_s = self.seconds
        point = {
            "seconds": round(self.seconds, 1),
            "steps": self.steps,
            **figures,
            "validation": score.record(),
            "validation_s": round(self._cost_s, 1),
        }
        self.curve.points.append(point)
        self._enough = wanted_arrivals(self.curve.points, self.request.algo)
        if score.is_better_than(self.best, self._enough):
            self.best = score
            self._save(network, score)
        write_json(self.folder / CURVE, self.curve.points)
        return score

    def loses_drives(self, score: Score) -> bool:
        """Whether fewer drives arrived than with the policy, or the machine, with which the training began."""
        return self._enough is not None and score.successes < self._enough

    def _save(self, network: Network, score: Score) -> None:
        provenance = {
            **network.provenance,
            "request": self.request.record(),
            **self._start,
            "settings": _plain(asdict(self.settings)),
            "training_seeds": f"{TRAINING_SEEDS.start} and up",
            "validation": score.record(),
            "validation_seeds": stretches(self._seeds),
            "seconds": round(self.seconds, 1),
            "steps": self.steps,
            "curve": self.curve.points[:: 1 + len(self.curve.points) // MAX_POINTS],
            "host": host(),
        }
        policy_file.save(replace(network, provenance=provenance), self.folder)


def _plain(value: Any) -> Any:
    """A value as JSON gives it back."""
    return json.loads(json.dumps(value))


def wanted_arrivals(points: list[dict[str, Any]], algo: str) -> int | None:
    """So many drives have to arrive, as for the policy with which the training began; None: it began with none.

    A training that begins with a policy drives a validation before its first decision. A policy that arrives seldom is
    to arrive more often before it becomes faster; a machine that is corrected is to become faster.
    """
    if not points or points[0]["steps"] > 0:
        return None
    start = Score(**points[0]["validation"])
    return start.successes if algo == "residual" else max(start.successes, math.ceil(ENOUGH * start.episodes))


def _best(points: list[dict[str, Any]], enough: int | None = None) -> Score | None:
    best: Score | None = None
    for point in points:
        score = Score(**point["validation"])
        best = score if score.is_better_than(best, enough) else best
    return best


def _machine(request: TrainRequest) -> dict[str, str | None]:
    """Digest of the machine that teaches or is corrected."""
    if request.algo not in ("teacher", "residual"):
        return {"sha256": None}
    text = tral_json.dumps(library.load(request.machine_name))
    return {"sha256": hashlib.sha256(text.encode()).hexdigest()}


_MAY_CHANGE = ("minutes", "steps", "nthread")
"""What of a request may differ from that of the training that is gone on with."""


def _resumed(folder: Path, asked: dict[str, Any]) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Curve and state of the training in a folder, if it is the one that is asked for."""
    if not (folder / CHECKPOINT).is_file():
        raise ConfigError(f"--resume: {folder} has no {CHECKPOINT}: leave --resume out to begin one there")
    try:
        old = json.loads((folder / REQUEST).read_text(encoding="utf-8"))
        points = json.loads((folder / CURVE).read_text(encoding="utf-8"))
        for part, values in asked.items():
            for name, value in values.items():
                if name not in old[part]:
                    raise ConfigError(
                        f"--resume: {folder} was begun by an older version, which knew no {_told(part, name)}: "
                        "begin anew in another --out"
                    )
                if name not in _MAY_CHANGE and old[part][name] != value:
                    raise ConfigError(
                        f"--resume: {folder} was trained with {_told(part, name)} = {old[part][name]!r}, "
                        f"got {value!r}: give the same, or another --out"
                    )
        _best(points)
        kept = torch.load(folder / CHECKPOINT, weights_only=True)  # runs no code
        # A training that was killed between the two files has a point of which the checkpoint knows nothing.
        return list(points)[: kept["points"]], dict(kept["state"])
    except ConfigError:
        raise
    except Exception as error:  # whatever a damaged file brings about in torch
        raise ConfigError(f"--resume: the files in {folder} are damaged: {error!r}") from error


def _told(part: str, name: str) -> str:
    return f"a machine with {name}" if part == "machine" else name
