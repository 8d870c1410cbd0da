"""Processes that drive: spawned, since threads and OpenGL contexts do not survive a fork; they never hear Ctrl-C."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from types import TracebackType
from typing import Any, Self, TypeVar

T = TypeVar("T")
_CALLS_BETWEEN_LOOKS = 32


class StoppedError(Exception):
    """A worker was told to give up its drives."""


class ProcessPool:
    """Workers; a context manager that gives up what they drive when an error leaves it."""

    def __init__(self, processes: int, begin: Callable[..., None] | None = None, *shared: Any) -> None:
        """No process starts before the first call.

        Args:
            processes: how many work.
            begin: called once in each of them.
            shared: its arguments, which may be what processes share: values, events, barriers of `spawned`.
        """
        self._stop = spawned.Event()
        self._executor = ProcessPoolExecutor(processes, spawned, _begin, (self._stop, begin, shared))

    def submit(self, work: Callable[..., T], *arguments: Any) -> Future[T]:
        """Let a worker do something."""
        with interrupts_ignored():
            return self._executor.submit(work, *arguments)

    def close(self, *, stop: bool = True) -> None:
        """End the workers.

        Args:
            stop: give up what they do; else wait for it.
        """
        if stop:
            self._stop.set()
        self._executor.shutdown(cancel_futures=stop)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        self.close(stop=kind is not None)


spawned = multiprocessing.get_context("spawn")
"""Where values, events and barriers that workers share come from."""


@contextlib.contextmanager
def interrupts_ignored() -> Iterator[None]:
    """Processes that start within never hear Ctrl-C, not even while they import; this one hears it right after."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Worker:
    """What a process of its own keeps from call to call."""

    stop: Any = None


def _begin(stop: Any, begin: Callable[..., None] | None, shared: tuple[Any, ...]) -> None:
    """Prepare a process. Ctrl-C is for the one that started it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _Worker.stop = stop
    if begin is not None:
        begin(*shared)


def stop_check() -> Callable[[object], None]:
    """A function to be called each tick of a drive: it raises `StoppedError` soon after the pool has been closed.

    In a process that is no worker it does nothing.
    """
    calls = 0

    def check(_: object) -> None:
        nonlocal calls
        calls += 1
        if calls % _CALLS_BETWEEN_LOOKS == 0 and _Worker.stop is not None and _Worker.stop.is_set():
            raise StoppedError

    return check
