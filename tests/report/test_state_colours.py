"""Colours of states."""

from tral_fsm.draw.panels import TONES
from tral_fsm.report.drive.state_colours import StateColours


def test_a_state_keeps_its_colour_and_the_next_state_gets_the_next() -> None:
    colours = StateColours(["turn", "follow", "turn"])
    assert (colours.tone("follow"), colours.tone("turn"), colours.tone("stop")) == (TONES[1], TONES[0], TONES[2])
    assert colours.states == ("turn", "follow", "stop")


def test_a_given_colour_is_that_of_the_machine_and_rgb_is_the_same() -> None:
    colours = StateColours(given={"turn": "#0b5cad"})
    assert colours.tone("turn") == "#0b5cad"
    assert colours.rgb("turn") == (0x0B, 0x5C, 0xAD)


def test_colours_repeat_after_the_last() -> None:
    colours = StateColours([str(k) for k in range(len(TONES) + 1)])
    assert colours.tone("0") == colours.tone(str(len(TONES)))
