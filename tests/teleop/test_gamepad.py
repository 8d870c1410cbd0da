"""The gamepad, without one: events as evdev gives them."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from hands_of import Event, Pad

from tral_env.errors import ConfigError, HardwareError, MissingExtraError, SourceLostError
from tral_fsm.teleop.gamepad import MAX_QUIET_S, Gamepad, open_gamepad
from tral_fsm.teleop.hands import Hands

KEY, ABS, SYN = 1, 3, 0
LB, B, START, BACK = 0x136, 0x131, 0x13B, 0x13A
HELD, RIGHT, LEFT = Event(KEY, LB, 1), Event(ABS, 5, 1023), Event(ABS, 2, 255)


def after(*events: Event, pad: Pad | None = None, now_s: float = 0.0) -> Hands:
    pad = pad or Pad()
    gamepad = Gamepad(pad)
    pad.waiting = list(events)
    return gamepad.poll(now_s)


def test_a_pad_at_rest_wants_nothing() -> None:
    assert after() == Hands()


def test_stick_and_triggers_go_from_end_to_end_whatever_their_range() -> None:
    assert after(Event(ABS, 0, -32768)).steering == 1.0
    assert after(Event(ABS, 0, 32767)).steering == -1.0
    assert after(RIGHT).throttle == 1.0
    assert after(LEFT).throttle == -1.0
    assert after(RIGHT, LEFT).throttle == 0.0


def test_buttons_hold_and_ask() -> None:
    hands = after(HELD, Event(KEY, START, 1), Event(KEY, B, 1), Event(KEY, BACK, 1))
    assert hands == Hands(holds=True, arm=True, stop=True, end=True)
    assert not after(HELD, Event(KEY, LB, 0)).holds


def test_a_button_asks_once_and_is_held_until_it_is_let_go() -> None:
    pad = Pad()
    gamepad = Gamepad(pad)
    pad.waiting = [HELD, Event(KEY, START, 1)]
    assert gamepad.poll(0.0).arm
    assert gamepad.poll(0.1) == Hands(holds=True)
    pad.waiting = [Event(KEY, START, 2), Event(KEY, START, 0)]  # it repeats, and is let go
    assert not gamepad.poll(0.2).arm


def test_events_that_the_kernel_dropped_count_as_a_button_that_was_let_go() -> None:
    assert not after(HELD, Event(SYN, 3, 0)).holds
    assert after(HELD, Event(SYN, 0, 0)).holds


def test_a_pad_that_is_unplugged_is_lost() -> None:
    pad = Pad()
    gamepad = Gamepad(pad)
    pad.error = OSError(19, "No such device")
    with pytest.raises(SourceLostError, match=r"gamepad X-Box 360 pad .*/dev/input/event5.* is gone .*No such device"):
        gamepad.poll(0.0)


@pytest.mark.parametrize("trigger", [Event(ABS, 5, 512), Event(ABS, 2, 200)])
def test_a_half_held_trigger_that_says_nothing_for_seconds_is_a_pad_out_of_reach(trigger: Event) -> None:
    pad = Pad()
    gamepad = Gamepad(pad)
    pad.waiting = [HELD, trigger]
    wanted = gamepad.poll(10.0)
    assert abs(wanted.throttle) > 0.4
    assert gamepad.poll(10.0 + MAX_QUIET_S) == wanted
    with pytest.raises(SourceLostError, match="nothing for 3 s"):
        gamepad.poll(10.01 + MAX_QUIET_S)


@pytest.mark.parametrize("events", [[HELD], [RIGHT], [Event(ABS, 5, 512)], []])
def test_a_pad_at_rest_may_be_quiet(events: list[Event]) -> None:
    pad = Pad()
    gamepad = Gamepad(pad)
    pad.waiting = list(events)
    wanted = gamepad.poll(0.0)
    assert gamepad.poll(100.0) == wanted


@pytest.mark.parametrize("triggers", [[RIGHT], [LEFT], [RIGHT, LEFT], [Event(ABS, 5, 1000)], [Event(ABS, 5, 20)]])
def test_a_trigger_at_its_end_stop_may_be_quiet(triggers: list[Event]) -> None:
    pad = Pad()
    gamepad = Gamepad(pad)
    pad.waiting = [HELD, *triggers]
    wanted = gamepad.poll(0.0)
    assert wanted.holds
    assert gamepad.poll(100.0) == wanted


def test_a_poll_takes_all_events_that_wait_and_no_endless_stream() -> None:
    shakes = [Event(ABS, 0, number) for number in range(200)]
    assert after(*shakes, HELD, Event(KEY, B, 1)).stop
    pad = Pad()
    gamepad = Gamepad(pad)
    pad.waiting = [HELD] * 100_000
    assert gamepad.poll(0.0).holds
    assert pad.waiting


def test_a_second_close_does_nothing() -> None:
    pad = Pad()
    gamepad = Gamepad(pad)
    gamepad.close()
    gamepad.close()
    assert pad.closed == 1


def test_a_device_without_a_range_is_no_pad(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Pad, "absinfo", lambda self, axis: SimpleNamespace(min=0, max=0))
    with pytest.raises(ConfigError, match="expected an XBOX pad"):
        Gamepad(Pad())


class Mouse(Pad):
    name = "mouse"

    def capabilities(self, absinfo: bool) -> dict[int, list[int]]:
        return {KEY: [0x110]}


class Real(Pad):
    def capabilities(self, absinfo: bool) -> dict[int, list[int]]:
        assert absinfo is False
        return {KEY: [LB, B], ABS: [0, 2, 5]}


def test_the_first_pad_among_all_devices_is_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []

    def device(path: str) -> Pad:
        opened.append(path)
        if path.endswith("0"):
            raise PermissionError(13, "Permission denied")
        return Mouse() if path.endswith("1") else Real()

    monkeypatch.setitem(sys.modules, "evdev", SimpleNamespace(InputDevice=device))
    monkeypatch.setattr(Path, "glob", lambda self, pattern: [self / f"event{number}" for number in (2, 1, 0)])
    assert open_gamepad().name == "gamepad X-Box 360 pad (/dev/input/event5)"
    assert opened == ["/dev/input/event0", "/dev/input/event1", "/dev/input/event2"]
    with pytest.raises(HardwareError, match="event1: mouse is no XBOX pad"):
        open_gamepad("/dev/input/event1")
    with pytest.raises(HardwareError, match=r"event0: .*Permission denied"):
        open_gamepad("/dev/input/event0")


def test_without_any_device_or_library_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "glob", lambda self, pattern: [])
    monkeypatch.setitem(sys.modules, "evdev", SimpleNamespace())
    with pytest.raises(HardwareError, match="no file /dev/input/event"):
        open_gamepad()
    monkeypatch.setitem(sys.modules, "evdev", None)
    with pytest.raises(MissingExtraError, match=r"\.\[gamepad\]"):
        open_gamepad()
