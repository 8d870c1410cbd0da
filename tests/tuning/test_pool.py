"""Processes that drive can be told to give up."""

from __future__ import annotations

import time

import pytest

from tral_fsm.evaluation.pool import ProcessPool, StoppedError, spawned, stop_check


def endless(began: object) -> None:
    check = stop_check()
    began.set()  # type: ignore[attr-defined]
    while True:
        check(0)
        time.sleep(0.001)


_began = None


def _keep(began: object) -> None:
    global _began
    _began = began


def work() -> None:
    endless(_began)


def test_an_error_gives_up_what_the_workers_drive() -> None:
    began = spawned.Event()
    with pytest.raises(KeyboardInterrupt), ProcessPool(1, _keep, began) as pool:  # noqa: PT012
        future = pool.submit(work)
        began.wait()
        raise KeyboardInterrupt
    assert isinstance(future.exception(), StoppedError)


def test_a_process_that_is_no_worker_is_never_stopped() -> None:
    check = stop_check()
    for _ in range(100):
        check(0)
