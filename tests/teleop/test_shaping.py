"""From the hand to a command."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.errors import ConfigError
from tral_fsm.teleop.hands import Hands
from tral_fsm.teleop.shaping import DeadMan, Shaping, command, with_expo, without_dead_zone

SHARE = st.floats(0.0, 0.9)
STICK = st.floats(-1.0, 1.0)
PLAIN = Shaping()


def driving(hands: Hands, shaping: Shaping = PLAIN) -> tuple[float, float]:
    """The command of hands that hold the button, once the trigger was at rest."""
    dead_man = DeadMan()
    command(Hands(holds=True), shaping, dead_man)
    return command(hands._replace(holds=True), shaping, dead_man)


@given(STICK, SHARE)
def test_the_dead_zone_is_flat_then_straight_to_the_end(value: float, zone: float) -> None:
    out = without_dead_zone(value, zone)
    assert out == -without_dead_zone(-value, zone)
    assert abs(out) <= 1.0
    assert (out == 0.0) == (abs(value) <= zone)
    assert without_dead_zone(1.0, zone) == 1.0
    assert without_dead_zone(2.0, zone) == 1.0


@given(STICK, st.floats(0.0, 1.0))
def test_expo_is_odd_finer_in_the_middle_and_the_same_at_the_ends(value: float, share: float) -> None:
    assert with_expo(value, share) == -with_expo(-value, share)
    assert abs(with_expo(value, share)) <= abs(value)
    assert with_expo(1.0, share) == pytest.approx(1.0)
    assert with_expo(value, 0.0) == value


@given(STICK, STICK)
def test_a_command_stays_within_its_limits(steering: float, throttle: float) -> None:
    turn, drive = driving(Hands(steering, throttle))
    assert abs(turn) <= 1.0
    assert abs(drive) <= Shaping().max_throttle


def test_ends_of_stick_and_trigger_are_full_lock_and_the_most_throttle() -> None:
    assert driving(Hands(1.0, 1.0)) == pytest.approx((1.0, 0.35))
    assert driving(Hands(-1.0, -1.0), Shaping(max_throttle=0.5)) == pytest.approx((-1.0, -0.5))
    assert driving(Hands(0.55, 0.0), Shaping(expo=0.5)) == pytest.approx((0.5 * 0.5 + 0.5 * 0.125, 0.0))


def test_without_the_button_the_car_is_straight_in_neutral() -> None:
    dead_man = DeadMan()
    command(Hands(holds=True), Shaping(), dead_man)
    assert command(Hands(1.0, 1.0, holds=False), Shaping(), dead_man) == (0.0, 0.0)


def test_a_trigger_that_is_held_when_the_button_is_pressed_makes_no_car_jump() -> None:
    dead_man, shaping = DeadMan(), Shaping()
    pressed = [command(Hands(0.0, throttle, holds=True), shaping, dead_man)[1] for throttle in (1.0, 0.5, 0.0, 0.55)]
    assert pressed == pytest.approx([0.0, 0.0, 0.0, 0.175])
    command(Hands(0.0, 0.55), shaping, dead_man)
    assert command(Hands(0.0, 0.55, holds=True), shaping, dead_man)[1] == 0.0


def test_a_trigger_at_rest_before_the_button_is_pressed_is_enough() -> None:
    dead_man, shaping = DeadMan(), Shaping()
    assert command(Hands(0.0, 0.55, holds=True), shaping, dead_man)[1] == 0.0
    command(Hands(), shaping, dead_man)
    assert command(Hands(0.0, 0.55, holds=True), shaping, dead_man)[1] == pytest.approx(0.175)


@pytest.mark.parametrize(
    ("field", "value"), [("dead_zone", 0.95), ("expo", -0.1), ("max_throttle", 1.5), ("expo", np.nan)]
)
def test_a_shaping_beyond_sense_is_refused(field: str, value: float) -> None:
    with pytest.raises(ConfigError, match=f"shaping: {field}"):
        Shaping(**{field: value})
