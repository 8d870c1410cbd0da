"""A person drives by keys of the page."""

import numpy as np

from tral_fsm.live.drive import LiveDrive
from tral_fsm.live.frame import Course
from tral_fsm.live.hands import BY_HAND, ByHand, Keys, finder
from tral_fsm.live.pace import Clock


def test_keys_that_are_held_drive_and_a_key_that_is_let_go_does_not() -> None:
    now, keys = [0.0], Keys()
    person = ByHand(keys, Clock(lambda: now[0], lambda seconds: None))
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
    live = LiveDrive(Course(scenario="straight", seed=1), ["wall"], find=finder(keys), keys=keys)
    live.shows_camera = False
    live.order(lambda drive: drive.lanes[0].take_driver(BY_HAND))
    live.turn()
    keys.press("w")
    live.turn()
    assert live.lanes[0].frame().action[1] > 0.1
    live.close()
