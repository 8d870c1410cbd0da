"""A person drives by keys of the page."""

from typing import Any, cast

import numpy as np

from tral_env.errors import SourceLostError
from tral_fsm.live.drive import LiveDrive
from tral_fsm.live.frame import Course
from tral_fsm.live.hands import BY_HAND, GAMEPAD, ByHand, Finder, Keys
from tral_fsm.live.pace import Clock
from tral_fsm.teleop.hands import Hands
from tral_fsm.teleop.keyboard import Keyboard


def test_keys_that_are_held_drive_and_a_key_that_is_let_go_does_not() -> None:
    now, keys = [0.0], Keys()
    person = ByHand(Keyboard(cast(Any, keys)), Clock(lambda: now[0], lambda seconds: None))
    assert person.act(np.zeros(1)).tolist() == [0.0, 0.0]
    keys.press("W")
    keys.press("A")
    steering, throttle = person.act(np.zeros(1)).tolist()
    assert steering > 0.5
    assert throttle > 0.1
    assert person.active_states == [BY_HAND]
    now[0] = 1.0
    assert person.act(np.zeros(1)).tolist() == [0.0, 0.0]
    assert person.active_states == ["let go"]


def test_a_person_takes_over_in_the_middle() -> None:
    keys = Keys()
    live = LiveDrive(Course(scenario="straight", seed=1), ["wall"], find=Finder(keys), keys=keys)
    live.shows_camera = False
    live.order(lambda drive: drive.lanes[0].take_driver(BY_HAND))
    live.turn()
    keys.press("w")
    live.turn()
    assert live.lanes[0].frame().action[1] > 0.1
    live.close()


class Pad:
    """A gamepad in no hands but the test's."""

    name = "gamepad of the test"

    def __init__(self) -> None:
        self.hands, self.is_closed, self.is_gone = Hands(), False, False

    def poll(self, now_s: float) -> Hands:
        if self.is_gone:
            raise SourceLostError("gamepad of the test is gone")
        return self.hands

    def close(self) -> None:
        self.is_closed = True


def test_a_gamepad_drives_while_its_dead_mans_button_is_held() -> None:
    pad = Pad()
    find = Finder(Keys(), lambda: pad)
    live = LiveDrive(Course(scenario="straight", seed=1), ["wall"], find=find)
    live.shows_camera = False
    live.order(lambda drive: drive.lanes[0].take_driver(GAMEPAD))
    live.turn()
    pad.hands = Hands(steering=1.0, throttle=1.0, holds=True)
    live.turn()
    steering, throttle = live.lanes[0].frame().action
    assert steering == 1.0
    assert throttle > 0.1
    pad.hands = Hands(steering=1.0, throttle=1.0)
    live.turn()
    assert live.lanes[0].frame().action == (0.0, 0.0)
    live.close()
    find.close()
    assert pad.is_closed


def test_a_gamepad_that_is_unplugged_pauses_the_drive_and_another_driver_goes_on() -> None:
    pad, told = Pad(), []
    live = LiveDrive(Course(scenario="straight", seed=1), [GAMEPAD], find=Finder(Keys(), lambda: pad), warn=told.append)
    live.shows_camera = False
    live.turn()
    pad.is_gone = True
    live.turn()
    assert live.frame.paused
    assert len(told) == 1
    assert "is gone" in told[0]
    live.order(lambda drive: drive.lanes[0].take_driver("wall"))
    live.order(lambda drive: drive.pause(False))
    before = live.lanes[0].frame().time_s
    live.turn()
    assert live.lanes[0].frame().time_s > before
    live.close()
