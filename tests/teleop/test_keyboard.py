"""Keys of a terminal, as a pseudo terminal gives them."""

from __future__ import annotations

import os
import termios

import pytest
from hands_of import Typed, pseudo_terminal

from tral_env.errors import ConfigError, SourceLostError
from tral_fsm.teleop.hands import Hands
from tral_fsm.teleop.keyboard import Keyboard, StopKeys, Terminal


def poll(device: Keyboard | StopKeys, terminal: Typed, keys: str, now_s: float = 0.0) -> Hands:
    terminal.waiting = keys
    return device.poll(now_s)


def keyboard() -> tuple[Keyboard, Typed]:
    terminal = Typed()
    return Keyboard(terminal), terminal  # type: ignore[arg-type]


def test_keys_come_at_once_and_arrows_are_letters() -> None:
    with pseudo_terminal() as (person, program), Terminal(program) as terminal:
        assert terminal.keys() == ""
        os.write(person, b"W\x1b[A\x1b[B\x1b[C\x1b[D ")
        assert terminal.keys() == "wwsda "
        assert terminal.keys() == ""


def test_bytes_of_no_letter_are_keys_too() -> None:
    with pseudo_terminal() as (person, program), Terminal(program) as terminal:
        os.write(person, b"\xff")
        assert len(terminal.keys()) == 1


def test_the_terminal_is_set_back() -> None:
    with pseudo_terminal() as (_, program):
        before = termios.tcgetattr(program)
        with Terminal(program):
            assert not termios.tcgetattr(program)[3] & termios.ICANON
            assert termios.tcgetattr(program)[3] & termios.ISIG  # Ctrl-C stays a signal
        assert termios.tcgetattr(program) == before


def test_a_terminal_that_is_gone_is_lost_and_not_silent() -> None:
    with pseudo_terminal() as (person, program):
        terminal = Terminal(program)
        terminal.__enter__()
        os.close(person)
        with pytest.raises(SourceLostError, match="the terminal is gone"):
            terminal.keys()
        terminal.__exit__()


def test_an_end_of_file_is_a_terminal_that_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    with pseudo_terminal() as (person, program), Terminal(program) as terminal:
        os.write(person, b"w")
        monkeypatch.setattr(os, "read", lambda file, size: b"")
        with pytest.raises(SourceLostError, match="the terminal is gone"):
            terminal.keys()


def test_a_file_is_no_terminal() -> None:
    read, write = os.pipe()
    with pytest.raises(ConfigError, match="no terminal"):
        Terminal(read)
    os.close(read)
    os.close(write)


def test_a_held_key_drives_and_the_car_rests_after_the_last_one() -> None:
    device, terminal = keyboard()
    assert poll(device, terminal, "w", 1.0) == Hands(0.0, 0.6, holds=True)
    assert poll(device, terminal, "", 1.7).throttle == 0.6
    assert poll(device, terminal, "", 1.71) == Hands()
    assert poll(device, terminal, "s", 2.0).throttle == -0.6


def test_steering_keeps_the_throttle_and_ends_by_itself() -> None:
    device, terminal = keyboard()
    poll(device, terminal, "w", 1.0)
    assert poll(device, terminal, "a", 1.5) == Hands(1.0, 0.6, holds=True)
    assert poll(device, terminal, "a", 2.0) == Hands(1.0, 0.6, holds=True)
    assert poll(device, terminal, "d", 2.3).steering == -1.0
    assert poll(device, terminal, "w", 2.9).steering == -1.0
    assert poll(device, terminal, "w", 3.1) == Hands(0.0, 0.6, holds=True)


def test_after_a_rest_steering_alone_does_not_drive() -> None:
    device, terminal = keyboard()
    poll(device, terminal, "w", 1.0)
    poll(device, terminal, "", 2.0)
    assert poll(device, terminal, "a", 2.1) == Hands(1.0, 0.0, holds=True)


def test_plus_and_minus_change_the_throttle_within_its_ends() -> None:
    device, terminal = keyboard()
    assert poll(device, terminal, "w+", 1.0).throttle == pytest.approx(0.7)
    assert poll(device, terminal, "w" + "+" * 9, 1.0).throttle == 1.0
    assert poll(device, terminal, "w" + "-" * 19, 1.0).throttle == 0.0


def test_keys_that_arm_stop_and_end() -> None:
    device, terminal = keyboard()
    assert poll(device, terminal, "r").arm
    assert poll(device, terminal, " ").stop
    assert poll(device, terminal, "q").end
    assert poll(device, terminal, "xyz") == Hands()
    device.close()


def test_beside_a_policy_any_other_key_stops() -> None:
    terminal = Typed()
    device = StopKeys(terminal)  # type: ignore[arg-type]
    assert poll(device, terminal, "") == Hands()
    assert poll(device, terminal, "r") == Hands(arm=True)
    assert poll(device, terminal, "q") == Hands(end=True)
    for key in " \n\x1bwe\ufffd":
        assert poll(device, terminal, key).stop
    device.close()


def test_a_terminal_that_nobody_entered_or_that_is_gone_needs_no_setting_back() -> None:
    with pseudo_terminal() as (_, program):
        before = termios.tcgetattr(program)
        terminal = Terminal(program)
        terminal.__exit__()
        assert termios.tcgetattr(program) == before
        terminal.__enter__()
        os.close(program)
        terminal.__exit__()
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(program)
