"""A real device in the hands of a person who drives: from its keys or events to the command of each tick."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hands_of import Event, Pad, Typed

from tral_fsm.teleop.gamepad import Gamepad
from tral_fsm.teleop.hands import Device
from tral_fsm.teleop.keyboard import Keyboard
from tral_fsm.teleop.overseer import Overseer
from tral_fsm.teleop.pilot import Pilot

TICK_S = 0.0125
FORWARD = 0.35 * 0.5 / 0.9
"""Throttle of the keyboard's first level, 0.6 of the trigger, behind the dead zone."""
LET_GO, LB = Event(1, 0x136, 0), Event(1, 0x136, 1)
PULLED, RELEASED = Event(3, 5, 1023), Event(3, 5, 0)


def driven(device: Device, does: Callable[[int], object], ticks: int) -> list[list[float]]:
    """Steering and throttle of each tick; `does` lets the person do something before a tick."""
    now = [0.0]
    overseer = Overseer([device], lambda: now[0])
    pilot = Pilot(overseer)
    pilot.reset()
    commands = []
    for tick in range(ticks):
        now[0] = tick * TICK_S
        does(tick)
        assert overseer.look() is None
        commands.append(pilot.act(np.zeros(3)).tolist())
    return commands


def by_keys(keys: dict[int, str], ticks: int) -> tuple[list[float], list[float]]:
    """Steering and throttle of each tick of a person who types at some of them."""
    terminal = Typed()

    def types(tick: int) -> None:
        terminal.waiting = keys.get(tick, "")

    commands = driven(Keyboard(terminal), types, ticks)  # type: ignore[arg-type]
    return [steering for steering, _ in commands], [throttle for _, throttle in commands]


def held(key: str, first: int, last: int) -> dict[int, str]:
    """A key that is held: it repeats after half a second, 20 times a second."""
    return {first: key} | dict.fromkeys(range(first + 40, last, 4), key)


def by_pad(does: dict[int, Sequence[Event]], ticks: int) -> list[float]:
    """Throttle of each tick."""
    pad = Pad()
    return [
        throttle for _, throttle in driven(Gamepad(pad), lambda tick: pad.waiting.extend(does.get(tick, ())), ticks)
    ]


@pytest.mark.parametrize(("key", "wanted"), [("w", FORWARD), ("s", -FORWARD)])
def test_a_key_that_is_held_drives_from_its_first_tick(key: str, wanted: float) -> None:
    _, throttle = by_keys(held(key, 1, 80), 80)
    assert throttle == pytest.approx([0.0] + [wanted] * 79)


def test_the_car_rests_after_the_last_key_and_drives_again_by_the_next() -> None:
    _, throttle = by_keys({1: "w", 100: "w"}, 110)
    assert throttle[1:57] == pytest.approx([FORWARD] * 56)  # 0.7 s
    assert throttle[58:100] == [0.0] * 42
    assert throttle[100:] == pytest.approx([FORWARD] * 10)


def test_a_key_steers_and_another_drives() -> None:
    steering, throttle = by_keys({1: "a", 5: "w"}, 10)
    assert steering[1:] == pytest.approx([1.0] * 9)
    assert throttle == pytest.approx([0.0] * 5 + [FORWARD] * 5)


def test_a_key_that_was_held_before_the_drive_began_has_to_be_let_go_once() -> None:
    _, throttle = by_keys({0: "w"} | held("w", 40, 120) | {200: "w"}, 210)
    assert throttle[:200] == [0.0] * 200
    assert throttle[200:] == pytest.approx([FORWARD] * 10)


def test_a_trigger_drives_while_the_button_is_held() -> None:
    throttle = by_pad({1: [LB], 3: [PULLED], 6: [LET_GO]}, 10)
    assert throttle == pytest.approx([0.0] * 3 + [0.35] * 3 + [0.0] * 4)


@pytest.mark.parametrize(
    "does", [{1: [PULLED], 3: [LB]}, {1: [LB], 2: [PULLED], 3: [LET_GO], 5: [LB]}, {0: [PULLED, LB]}]
)
def test_the_button_under_a_trigger_that_is_held_makes_no_car_jump(does: dict[int, Sequence[Event]]) -> None:
    assert by_pad(does | {8: [RELEASED], 9: [PULLED]}, 12)[3:] == pytest.approx([0.0] * 6 + [0.35] * 3)
