"""Drives on the workers of a Dask cluster, here or on other computers; the share of a lost worker is driven again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any, Self, TypeVar

from tral_env.errors import ConfigError, LostWorkerError, MissingExtraError
from tral_env.recording.about import versions

Workers = int | str
"""Number of processes of this computer, or address of a Dask scheduler, such as "tcp://127.0.0.1:8786"."""
SHARES = 2
"""Calls for each worker: so many as the loss of a worker costs half of what it does. Source: choice; in small batches
a drive takes longer."""
MAX_WAIT_S = 60.0
"""Without any worker for this long the work is given up. Source: choice; a computer that starts again takes longer."""
_CONNECT_S = 10
_LOOK_S = 1.0

T = TypeVar("T")
R = TypeVar("R")


class Cluster:
    """The workers of a scheduler that somebody has started: `dask scheduler` and `dask worker ADDRESS --nthreads 1`."""

    def __init__(self, address: str) -> None:
        """Connect to the scheduler.

        Args:
            address: of the scheduler, as it tells it.

        Raises:
            MissingExtraError: Dask is not installed.
            ConfigError: there is no scheduler, it has no worker, or a worker has other versions.
        """
        try:
            import distributed
        except ModuleNotFoundError as error:
            raise MissingExtraError("distributed", "cluster", "a Dask cluster") from error
        self._dask: Any = distributed
        try:
            self._client: Any = distributed.Client(address, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ConfigError(f"--cluster {address}: no Dask scheduler ({error}). Start one: dask scheduler") from error
        try:
            self._check(address)
        except BaseException:
            self._client.close()
            raise

    def _check(self, address: str) -> None:
        """Refuse a cluster whose drives would differ from those of this program."""
        told = self._client.run(versions, on_error="ignore")
        if not told:
            raise ConfigError(f"--cluster {address}: no worker. Start some: dask worker {address} --nthreads 1")
        for worker, theirs in told.items():
            for name, mine in versions().items():
                if theirs.get(name) != mine:
                    raise ConfigError(
                        f"--cluster {address}: the worker {worker} has {name} {theirs.get(name, 'not installed')}, "
                        f"this program {mine}: install the same, because their drives may differ"
                    )

    @property
    def workers(self) -> int:
        """Number of workers now."""
        return len(self._client.nthreads())

    @property
    def shares(self) -> int:
        """Number of calls into which work should be cut, at least 1."""
        return max(SHARES * self.workers, 1)

    def call_all(self, work: Callable[[T], R], calls: Sequence[T], on_done: Callable[[int, R], None]) -> None:
        """Let workers do all calls; a call whose worker is lost goes to another one.

        Args:
            work: function that workers can import, or of the program that was started.
            calls: its arguments.
            on_done: gets the number and the result of each call as it ends.

        Raises:
            LostWorkerError: all workers were lost, or one call has cost several.
        """
        futures = self._client.map(work, calls, pure=False)
        number = {future.key: k for k, future in enumerate(futures)}
        waiting, alone_s = set(futures), 0.0
        try:
            while waiting:
                try:
                    with self._client.as_current():
                        done, waiting = self._dask.wait(waiting, _LOOK_S, "FIRST_COMPLETED")
                except TimeoutError:
                    alone_s = 0.0 if self.workers else alone_s + _LOOK_S
                    if alone_s > MAX_WAIT_S:
                        raise LostWorkerError("the cluster has no worker left: start some, and this again") from None
                    continue
                for future in done:
                    on_done(number[future.key], future.result())
        except self._dask.KilledWorker as error:
            raise LostWorkerError(
                f"several workers of the cluster were lost at one share, most often because memory was short: {error}"
            ) from error
        finally:
            self._client.cancel(futures)

    def close(self) -> None:
        """Leave the cluster; its workers stay, and give up what has not begun."""
        self._client.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        self.close()
