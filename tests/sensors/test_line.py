"""The line sensor: eight diodes over floor tape, one byte."""

from __future__ import annotations

import numpy as np
import pytest

from tral_env.config import LineConfig
from tral_env.sensors.line import diode_places, line_byte

CONFIG = LineConfig()
AHEAD = np.array([[[0.0, 0.0, 2.0, 0.0]]])


def at(y: float, yaw: float = 0.0, x: float = 0.0) -> np.ndarray:
    return np.array([[x, y, yaw]])


def test_tape_below_the_middle_shows_in_the_two_middle_diodes() -> None:
    # Diodes at +-4.8 and +-14.3 mm; tape 19 mm wide reaches to 9.5 mm.
    assert line_byte(at(0.0), AHEAD, CONFIG)[0] == 0b00011000


def test_wide_tape_shows_in_the_same_two_diodes() -> None:
    assert line_byte(at(0.0), AHEAD, LineConfig(tape_width=0.025))[0] == 0b00011000


def test_bit_7_is_the_leftmost_diode() -> None:
    assert diode_places(CONFIG)[7, 1] == pytest.approx(0.0333375)
    assert line_byte(at(-0.0333375), AHEAD, CONFIG)[0] == 0b10000000


def test_tape_to_the_right_shows_in_the_low_bits() -> None:
    assert line_byte(at(0.0333375), AHEAD, CONFIG)[0] == 0b00000001


def test_tape_beside_the_row_shows_nothing() -> None:
    assert line_byte(at(0.05), AHEAD, CONFIG)[0] == 0


def test_tape_that_ends_before_the_row_shows_nothing() -> None:
    assert line_byte(at(0.0, x=2.0), AHEAD, CONFIG)[0] == 0


def test_tape_across_the_way_shows_in_all_diodes() -> None:
    across = np.array([[[CONFIG.x, -1.0, CONFIG.x, 1.0]]])
    assert line_byte(at(0.0), across, CONFIG)[0] == 0b11111111


def test_turned_car_sees_the_tape_where_its_nose_is() -> None:
    # Nose 0.3 m ahead and turned left by 0.1 rad: the tape is 30 mm to the right of it.
    assert line_byte(at(0.0, yaw=0.1), AHEAD, CONFIG)[0] == 0b00000011


@pytest.mark.parametrize("padding", [0.0, 0.3, np.nan])
def test_padding_is_no_tape(padding: float) -> None:
    tape = np.concatenate([np.full((1, 3, 4), padding), AHEAD], axis=1)
    assert line_byte(at(0.0), tape, CONFIG)[0] == 0b00011000
    assert line_byte(at(0.0), np.full((1, 3, 4), padding), CONFIG)[0] == 0


def test_no_tape_at_all_reads_zero() -> None:
    assert line_byte(at(0.0), np.zeros((1, 0, 4)), CONFIG)[0] == 0


def test_course_can_be_shared_by_all_rows() -> None:
    pose = np.concatenate([at(0.0), at(0.05)])
    assert line_byte(pose, AHEAD[0], CONFIG).tolist() == [0b00011000, 0]


def test_rows_do_not_touch_each_other() -> None:
    rng = np.random.default_rng(2)
    pose = np.column_stack([rng.uniform(0, 1, 8), rng.uniform(-0.04, 0.04, 8), rng.uniform(-0.1, 0.1, 8)])
    together = line_byte(pose, AHEAD[0], CONFIG)
    assert together.tolist() == [int(line_byte(pose[i : i + 1], AHEAD[0], CONFIG)[0]) for i in range(8)]
