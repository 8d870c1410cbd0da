"""n cars in n corridors, their rows cut in shares that run in processes: each share is a `TralCorridorVectorEnv`.

One process steps the cars on several threads, but computes their sensors, rewards and resets on one. Processes do
all of it at once. A share answers over pipes; what the shares answer is laid together row by row.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from tral_env.decisions import CorrectablePolicy
from tral_env.errors import ConfigError, LostWorkerError
from tral_env.interface import FloatArray, as_command
from tral_env.options import JsonSpec, check_counts
from tral_env.vector_env import TralCorridorVectorEnv, seeds_of_rows
from tral_env.vector_worker import packed, receive, send

_END_S = 5.0
"""A process that was told to end is killed after this time."""


def vector_env(
    num_envs: int = 1, *, processes: int = 1, **options: Any
) -> TralCorridorVectorEnv | TralCorridorProcesses:
    """The vector environment, in this process or in several: what ``gym.make_vec("TralCorridor-v0")`` makes.

    Args:
        num_envs: number of cars, n.
        processes: how many processes drive them; 1: this one.
        options: those of `TralCorridorVectorEnv`.
    """
    check_counts(num_envs=num_envs, processes=processes)
    if processes == 1:
        return TralCorridorVectorEnv(num_envs, **options)
    return TralCorridorProcesses(num_envs, processes, **options)


class TralCorridorProcesses(JsonSpec, VectorEnv[FloatArray, FloatArray, NDArray[Any]]):
    """`TralCorridor-v0`, n at once, in processes: ``gym.make_vec("TralCorridor-v0", num_envs=256, processes=2)``.

    Rows, options and answers are those of `TralCorridorVectorEnv`, bit for bit; `nthread` is that of each process, 1 by
    default. Where the mask of an entry of `info` is false, the entry means nothing. A reset that is refused for the
    rows of one process alone has begun episodes in those of the others: reset all rows, with a seed, after it.
    """

    def __init__(self, num_envs: int, processes: int, *, nthread: int = 1, **options: Any) -> None:
        """Start the processes.

        Raises:
            ConfigError: more processes than cars, or an option is unknown or not allowed.
            LostWorkerError: a process did not start.
        """
        check_counts(num_envs=num_envs, processes=processes)
        if processes > num_envs:
            raise ConfigError(f"processes = {processes}: expected at most one for each of the {num_envs} cars")
        self.num_envs = num_envs
        bounds = [num_envs * k // processes for k in range(processes + 1)]
        self._shares: list[_Share] = []
        made = options | {"nthread": nthread}
        try:
            for first, end in pairwise(bounds):
                self._shares.append(_Share(first, end))
            about = self._ask("make", [(end - first, made) for first, end in self._rows_of_shares])[0]
        except BaseException:
            self.close()
            raise
        self.metadata, self.render_mode = about["metadata"], about["render_mode"]
        self.provided_readings: frozenset[str] = about["provided_readings"]
        self.learner_options: dict[str, object] = about["learner_options"]
        self.single_observation_space, self.single_action_space = about["spaces"]
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def correct(self, policy: CorrectablePolicy, steering: float, speed: float) -> None:
        """See `TralCorridorVectorEnv.correct`; each process drives its cars with a copy of the policy."""
        self._ask("correct", [(policy, steering, speed)] * len(self._shares))

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """See `TralCorridorVectorEnv.reset`."""
        seeds = seeds_of_rows(seed, self.num_envs)
        answers = self._ask("reset", [(seeds[a:b], self._options(options, a, b)) for a, b in self._rows_of_shares])
        return np.concatenate([each[0] for each in answers]), self._joined([each[1] for each in answers])

    def step(self, actions: FloatArray) -> tuple[FloatArray, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """See `TralCorridorVectorEnv.step`."""
        command = as_command(actions, self.num_envs)
        answers = self._ask("step", [(command[a:b],) for a, b in self._rows_of_shares])
        observation, reward, terminated, truncated = (np.concatenate([each[k] for each in answers]) for k in range(4))
        return observation, reward, terminated, truncated, self._joined([each[4] for each in answers])

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """See `TralCorridorVectorEnv.render`."""
        return None if self.render_mode is None else self.render_rows(range(self.num_envs))

    def render_rows(self, rows: Iterable[int]) -> tuple[NDArray[np.uint8], ...]:
        """See `TralCorridorVectorEnv.render_rows`."""
        wanted = [range(self.num_envs)[row] for row in rows]
        own = [[row for row in wanted if a <= row < b] for a, b in self._rows_of_shares]
        asked = [([row - share.first for row in rows],) for share, rows in zip(self._shares, own, strict=True)]
        pictures = {
            row: picture
            for rows, answer in zip(own, self._ask("render_rows", asked), strict=True)
            for row, picture in zip(rows, answer, strict=True)
        }
        return tuple(pictures[row] for row in wanted)

    def close_extras(self, **kwargs: Any) -> None:
        """End the processes."""
        for share in self._shares:
            share.hang_up()
        for share in self._shares:
            share.end()

    @property
    def _rows_of_shares(self) -> list[tuple[int, int]]:
        return [(share.first, share.stop) for share in self._shares]

    def _options(self, options: dict[str, Any] | None, first: int, end: int) -> dict[str, Any] | None:
        """The options of a reset for the rows of a share."""
        if not isinstance(options, dict):
            return options
        found = dict(options)
        if "reset_mask" in found:
            mask = np.asarray(found["reset_mask"])
            if mask.shape != (self.num_envs,) or mask.dtype != bool:
                raise ConfigError(f"reset_mask is {mask.dtype} {mask.shape}: expected bool ({self.num_envs},)")
            found["reset_mask"] = mask[first:end]
        if isinstance(found.get("car"), Mapping):
            found["car"] = {name: self._of_rows(name, value, first, end) for name, value in found["car"].items()}
        return found

    def _of_rows(self, name: str, value: Any, first: int, end: int) -> Any:
        """A parameter of the car as it is, or the values of some rows where each row has its own."""
        if np.ndim(value) == 0:
            return value
        if len(value) != self.num_envs:
            raise ConfigError(f"options['car']: {name} has {len(value)} values: expected one, or {self.num_envs}")
        return value[first:end]

    def _joined(self, infos: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
        """The infos of all shares as one; rows of a share without an entry have zeros, and False in its mask."""
        joined: dict[str, Any] = _laid_together(infos, [end - first for first, end in self._rows_of_shares])
        return joined

    def _ask(self, name: str, arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Let each share do something, all at once; an exception of a share is raised when all are done.

        Raises:
            ConfigError: an argument cannot be pickled; no share was asked.
            LostWorkerError: a process is gone, or the environment is closed.
        """
        if self.closed:
            raise LostWorkerError("the environment is closed: make it anew")
        try:
            requests = [packed((name, each)) for each in arguments]
        except (AttributeError, TypeError, pickle.PicklingError) as error:
            raise ConfigError(f"{name}: {error}: with processes=1 it need not be pickled") from error
        try:
            for share, request in zip(self._shares, requests, strict=True):
                share.ask(request)
            answers = [share.answer() for share in self._shares]
        except BaseException:  # also Ctrl-C: an answer may have been read in part
            self.close()
            raise
        for share, (is_well, answer) in zip(self._shares, answers, strict=True):
            if not is_well:
                answer.add_note(
                    f"in the process of the rows {share.first} to {share.stop - 1}, which counts them from 0"
                )
                raise answer
        return [answer for _, answer in answers]


def _laid_together(parts: Sequence[Any], sizes: Sequence[int]) -> Any:
    """Arrays (k, ...) of shares as one (n, ...), and so within mappings; None: the share has no such entry."""
    known = next(part for part in parts if part is not None)
    if isinstance(known, Mapping):
        names = dict.fromkeys(name for part in parts if part is not None for name in part)
        return {name: _laid_together([None if p is None else p.get(name) for p in parts], sizes) for name in names}
    empty = [
        np.zeros((size, *known.shape[1:]), known.dtype) if part is None else part
        for part, size in zip(parts, sizes, strict=True)
    ]
    return np.concatenate(empty)


class _Share:
    """The rows from `first` to before `stop`, in a process."""

    def __init__(self, first: int, stop: int) -> None:
        self.first, self.stop = first, stop
        # The process finds what this program finds, for instance a policy beside the script, and nothing else: without
        # -P, a random.py in the current folder would stand before that of Python.
        found = os.environ | {"PYTHONPATH": os.pathsep.join(str(path or Path.cwd()) for path in sys.path)}
        worker = [sys.executable, "-P", "-m", "tral_env.vector_worker"]
        try:
            self._process = subprocess.Popen(worker, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=found)
        except OSError as error:
            raise LostWorkerError(f"the process of the rows {first} to {stop - 1} did not start: {error}") from error

    def ask(self, request: bytes) -> None:
        """Begin something: a name and arguments, packed.

        Raises:
            LostWorkerError: the process is gone.
        """
        assert self._process.stdin is not None
        try:
            send(self._process.stdin, request)
        except OSError as error:
            raise self._lost() from error

    def answer(self) -> tuple[bool, Any]:
        """Wait for its end: whether it went well, and the answer or the exception.

        Raises:
            LostWorkerError: the process is gone.
        """
        assert self._process.stdout is not None
        try:
            answer: tuple[bool, Any] = pickle.loads(receive(self._process.stdout))
        except (EOFError, OSError) as error:
            raise self._lost() from error
        return answer

    def hang_up(self) -> None:
        """Let the process end: nothing more comes, and an answer that it writes is not waited for."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        for stream in (self._process.stdout, self._process.stdin):
            with suppress(OSError):
                stream.close()

    def end(self) -> None:
        """Wait until the process has ended; it is killed if it does not."""
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _lost(self) -> LostWorkerError:
        try:
            code: int | None = self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            code = None
        if code == -signal.SIGKILL:
            why = "most often because memory was short: make the environment anew, with fewer processes or cars"
        else:
            why = "and its last lines on the terminal tell why: make the environment anew"
        return LostWorkerError(
            f"the process of the rows {self.first} to {self.stop - 1} is gone (exit code {code}), {why}"
        )
