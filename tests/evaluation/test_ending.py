"""SIGTERM and SIGHUP end a program as Ctrl-C does."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from tral_fsm.evaluation.ending import ToldToEnd, ending_cleanly


@pytest.fixture(autouse=True)
def _as_in_a_shell() -> None:
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_is_raised_where_the_program_is_and_given_back(number: signal.Signals) -> None:
    with pytest.raises(ToldToEnd) as told, ending_cleanly():
        os.kill(os.getpid(), number)
    assert told.value.exit_code == 128 + number
    assert signal.getsignal(number) is signal.SIG_DFL


def test_a_second_signal_ends_the_process_at_once() -> None:
    with ending_cleanly():
        with pytest.raises(ToldToEnd):
            os.kill(os.getpid(), signal.SIGTERM)
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_what_nohup_ignores_stays_ignored() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with ending_cleanly():
        os.kill(os.getpid(), signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def test_a_handler_that_was_put_in_meanwhile_stays() -> None:
    def own(*_: object) -> None:
        """Do nothing."""

    with ending_cleanly():
        signal.signal(signal.SIGTERM, own)
    assert signal.getsignal(signal.SIGTERM) is own


def test_another_thread_takes_no_signals() -> None:
    seen: list[object] = []

    def work() -> None:
        with ending_cleanly():
            seen.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [signal.SIG_DFL]
