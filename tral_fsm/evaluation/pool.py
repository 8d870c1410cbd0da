"""Processes that drive: spawned, because threads and OpenGL contexts do not survive a fork.

They ignore Ctrl-C, which is for the process that started them, and they end when that process ends, however it does.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor
from concurrent.futures import wait as wait_for
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait
from types import TracebackType
from typing import Any, Self, TypeVar

from tral_env.errors import LostWorkerError

T = TypeVar("T")
_CHECK_EVERY = 32


class StoppedError(Exception):
    """The pool told a worker to give up its drives."""


@contextlib.contextmanager
def worker_losses() -> Iterator[None]:
    """Tell the loss of a worker with its remedy.

    Raises:
        LostWorkerError: the system ended a worker.
    """
    try:
        yield
    except BrokenProcessPool as error:
        raise LostWorkerError(
            "the system ended a process that was driving, most often because memory was short: use fewer processes"
        ) from error


class ProcessPool:
    """Worker processes; at an error the context manager makes them give up their drives."""

    def __init__(self, processes: int, begin: Callable[..., None] | None = None, *shared: Any) -> None:
        """Make the pool; no process starts before the first call.

        Args:
            processes: number of workers.
            begin: called once in each worker.
            shared: arguments of `begin`; also values, events and barriers of `spawned`, which workers share.
        """
        self._stop = spawned.Event()
        self._executor = ProcessPoolExecutor(processes, spawned, _begin, (self._stop, begin, shared))

    def submit(self, work: Callable[..., T], *arguments: Any) -> Future[T]:
        """Let a worker call a function."""
        with interrupts_ignored():
            return self._executor.submit(work, *arguments)

    def close(self, *, stop: bool = True) -> None:
        """End the workers.

        Args:
            stop: whether they give up their calls; else wait for these.
        """
        if stop:
            self._stop.set()
        self._executor.shutdown(cancel_futures=stop)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        self.close(stop=kind is not None)


spawned = multiprocessing.get_context("spawn")
"""Context that makes values, events and barriers for workers to share."""


@contextlib.contextmanager
def interrupts_ignored() -> Iterator[None]:
    """Processes that start within ignore Ctrl-C, even while they import; this process gets it at the end."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Worker:
    """State that a worker keeps from call to call."""

    stop: Any = None
    sender: Any = None
    turn: Any = None


def _begin(stop: Any, begin: Callable[..., None] | None, shared: tuple[Any, ...]) -> None:
    """Prepare a worker; Ctrl-C is for the process that started it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    _Worker.stop = stop
    if begin is not None:
        begin(*shared)


def call_all(work: Callable[[T], None], calls: Sequence[T], processes: int, on_told: Callable[[Any], None]) -> None:
    """Let workers do all calls; what they tell meanwhile arrives at once, also what they tell until an error.

    Args:
        work: function that workers call; it may use `tell`.
        calls: its arguments.
        processes: number of workers.
        on_told: gets what the workers tell, in a thread of its own.

    Raises:
        LostWorkerError: the system ended a worker.
    """
    receiver, sender = spawned.Pipe(duplex=False)
    with (
        _heard(receiver, on_told) as errors,
        contextlib.closing(sender),
        ProcessPool(processes, _take_sender, sender, spawned.Lock()) as pool,
        worker_losses(),
    ):
        waiting = {pool.submit(work, call) for call in calls}
        while waiting and not errors:
            done, waiting = wait_for(waiting, timeout=0.5, return_when=FIRST_COMPLETED)
            for future in done:
                future.result()
        if errors:
            raise errors[0]


def tell(value: object) -> None:
    """Send a value from a worker of `call_all` to the process that started it."""
    with _Worker.turn:
        _Worker.sender.send(value)


def _take_sender(sender: Any, turn: Any) -> None:
    """Begin a worker that tells."""
    _Worker.sender, _Worker.turn = sender, turn


@contextlib.contextmanager
def _heard(receiver: Any, on_told: Callable[[Any], None]) -> Iterator[list[Exception]]:
    """Hear in a thread until all senders are closed; give the list of the errors of `on_told`, which ends with one."""
    errors: list[Exception] = []

    def hear() -> None:
        while True:
            try:
                value = receiver.recv()
            except (EOFError, OSError):  # OSError: a worker was killed while it sent
                return
            try:
                if not errors:
                    on_told(value)
            except Exception as error:  # the thread goes on, or the workers would wait for it
                errors.append(error)

    thread = threading.Thread(target=hear, name="hear workers", daemon=True)
    thread.start()
    try:
        yield errors
    finally:
        thread.join()
        receiver.close()
    if errors:
        raise errors[0]


def end_with_parent() -> None:
    """Let this process end as soon as the process that started it has ended, killed or not.

    It does nothing in a process that `multiprocessing` did not start.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, name="end with parent", daemon=True).start()


def stop_check() -> Callable[[object], None]:
    """A function to call in each tick of a drive: it raises `StoppedError` soon after the pool was stopped.

    It does nothing in a process that is no worker.
    """
    calls = 0

    def check(_: object) -> None:
        nonlocal calls
        calls += 1
        if calls % _CHECK_EVERY == 0 and _Worker.stop is not None and _Worker.stop.is_set():
            raise StoppedError

    return check
