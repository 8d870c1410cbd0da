"""Who may stop a drive, and who may arm."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest
from hands_of import LOST, Script

from tral_env.errors import ConfigError
from tral_fsm.teleop.hands import Hands
from tral_fsm.teleop.overseer import End, Overseer, Signals
from tral_fsm.teleop.pilot import Pilot

AT_REST, HELD = Hands(), Hands(holds=True)


def overseer(*hands: Hands | Exception, must_hold: bool = False, signals: Signals | None = None) -> Overseer:
    names = ("gamepad", "keyboard")
    devices = [Script(name, lambda polls, now=now: now) for name, now in zip(names, hands, strict=False)]
    return Overseer(devices, lambda: 0.0, signals, must_hold=must_hold)


def test_nobody_who_wants_anything_lets_the_drive_go_on() -> None:
    assert overseer(AT_REST, AT_REST).look() is None
    assert overseer().look() is None


@pytest.mark.parametrize("place", [0, 1])
def test_each_device_stops_and_ends(place: int) -> None:
    name = ("gamepad", "keyboard")[place]

    def with_other(hands: Hands) -> Overseer:
        return overseer(*([hands, AT_REST] if place == 0 else [AT_REST, hands]))

    assert with_other(Hands(stop=True)).look() == End(f"emergency stop by the {name}", failed=True)
    assert with_other(Hands(end=True)).look() == End(f"ended by the {name}")
    assert with_other(Hands(stop=True, end=True)).look() == End(f"emergency stop by the {name}", failed=True)


@pytest.mark.parametrize("hands", [(LOST, AT_REST), (AT_REST, LOST)])
def test_a_device_that_is_lost_stops_the_car_and_no_other_takes_over(hands: tuple[Hands, Exception]) -> None:
    watched = overseer(*hands)
    assert watched.look() == End("the pad is gone", failed=True)
    assert watched.hands == AT_REST
    assert watched.asks_to_arm() == End("the pad is gone", failed=True)


def test_hands_that_held_when_their_device_was_lost_hold_no_more() -> None:
    watched = Overseer([Script("gamepad", lambda polls: HELD if polls == 1 else LOST)], lambda: 0.0)
    assert watched.look() is None
    assert watched.hands == HELD
    assert watched.look() == End("the pad is gone", failed=True)
    assert watched.hands == AT_REST


def test_a_dead_mans_button_that_is_let_go_ends_the_drive_of_a_policy() -> None:
    assert overseer(HELD, must_hold=True).look() is None
    assert overseer(AT_REST, HELD, must_hold=True).look() == End("the dead man's button of the gamepad was let go")


def test_each_device_arms_and_none_without_the_held_button() -> None:
    assert overseer(AT_REST, Hands(arm=True)).asks_to_arm() is True
    assert overseer(AT_REST, AT_REST).asks_to_arm() is False
    assert overseer(AT_REST, Hands(arm=True), must_hold=True).asks_to_arm() is False
    assert overseer(HELD, Hands(arm=True), must_hold=True).asks_to_arm() is True


def test_what_was_pressed_before_anyone_was_asked_arms_nothing() -> None:
    pressed = Script("gamepad", lambda polls: Hands(arm=True) if polls == 1 else AT_REST)
    watched = Overseer([pressed], lambda: 0.0)
    assert watched.before_asking() is None
    assert watched.asks_to_arm() is False
    assert overseer(Hands(stop=True)).before_asking() == End("emergency stop by the gamepad", failed=True)


def test_an_emergency_stop_is_no_permission_to_arm() -> None:
    assert overseer(Hands(arm=True, stop=True)).asks_to_arm() == End("emergency stop by the gamepad", failed=True)


@pytest.mark.parametrize("number", Signals.NUMBERS)
def test_a_signal_ends_the_drive_at_its_next_tick_and_a_second_one_at_once(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with Signals() as signals:
        watched = overseer(AT_REST, signals=signals)
        assert watched.look() is None
        os.kill(os.getpid(), number)
        assert watched.look() == End(number.name)
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)
    assert signal.getsignal(number) == before


def test_a_person_is_a_policy() -> None:
    script = Script("gamepad", lambda polls: Hands(1.0, 0.0 if polls == 1 else 1.0, holds=polls < 3))
    watched = Overseer([script], lambda: 0.0)
    pilot = Pilot(watched)
    pilot.reset()
    commands = []
    for _ in range(3):
        watched.look()
        commands.append(pilot.act(np.zeros(3)).tolist())
    assert np.allclose(commands, [[1.0, 0.0], [1.0, 0.35], [0.0, 0.0]])
    assert pilot.active_states == ["let go"]
    with pytest.raises(ConfigError, match="one car"):
        pilot.reset(2)
