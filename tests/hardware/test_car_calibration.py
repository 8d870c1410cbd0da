"""A car calibration: the file, and the law between commands and pulses."""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.errors import CalibrationError, ConfigError, UnreadableCalibrationError
from tral_env.hardware import calibration_file
from tral_env.hardware.calibration_file import json_schema, load_calibration, packaged_calibrations, parse_calibration
from tral_env.hardware.pulses import action_of, limit_slew, pulses

TT01 = load_calibration("tt01")
PACKAGED = Path(calibration_file.__file__).parent / "calibrations"
commands = st.floats(-1, 1)


def changed(**sections):
    """The packaged calibration with some values changed: steering={...}, throttle={...} or plain values."""
    content = json.loads((PACKAGED / "tt01.json").read_text())
    for name, value in sections.items():
        if isinstance(value, dict):
            content[name].update(value)
        else:
            content[name] = value
    return json.dumps(content)


TRIMMED = parse_calibration(
    changed(steering={"trim_us": 37}, throttle={"skip_dead_zone": True}), "trimmed car, dead zone skipped"
)
both = st.sampled_from([TT01, TRIMMED])


@given(st.integers(1400, 1600))
def test_a_whole_pulse_may_be_written_with_a_point(neutral):
    read = parse_calibration(changed(steering={"neutral_us": float(neutral)}, period_us=17430.0), "car.json")
    assert (read.steering.neutral_us, read.period_us) == (neutral, 17430)


def test_half_a_microsecond_is_refused():
    with pytest.raises(CalibrationError, match=r"steering.neutral_us: got 1530.5: Input should be a valid integer"):
        parse_calibration(changed(steering={"neutral_us": 1530.5}), "car.json")


@pytest.mark.parametrize(
    ("action", "expected"),
    [
        ((0, 0), (1530, 1530)),
        ((1, 1), (1240, 1140)),
        ((-1, -1), (1810, 1860)),
        ((0.5, 0.5), (1385, 1335)),
        ((-0.5, -0.5), (1670, 1695)),
        ((7, -7), (1240, 1860)),
    ],
)
def test_pulses_of_the_2016_car(action, expected):
    assert pulses(action, TT01).tolist() == list(expected)


def test_trim_moves_straight_and_leaves_full_lock():
    steering = pulses([[1, 0], [0, 0], [-1, 0]], TRIMMED)[:, 0]
    assert steering.tolist() == [1240, 1567, 1810]


def test_skipping_the_dead_zone_starts_beside_it():
    throttle = pulses([[0, 1], [0, 1e-9], [0, 0], [0, -1e-9], [0, -1]], TRIMMED)[:, 1]
    assert throttle == pytest.approx([1140, 1480, 1530, 1580, 1860], abs=1e-5)
    assert throttle[[0, 2, 4]].tolist() == [1140, 1530, 1860]


@given(both, commands, commands)
def test_more_command_never_means_less_pulse(car, a, b):
    low, high = sorted((a, b))
    assert (pulses([high, high], car) <= pulses([low, low], car)).all()


@given(both, commands, commands)
def test_pulses_lead_back_to_the_command(car, steering, throttle):
    assert action_of(pulses([steering, throttle], car), car) == pytest.approx([steering, throttle], abs=1e-12)


@given(both, st.floats(allow_nan=False, allow_infinity=False), st.floats(allow_nan=False, allow_infinity=False))
def test_hard_limits_hold_for_every_finite_command(car, steering, throttle):
    shortest, longest = car.limits_us
    assert (shortest <= pulses([steering, throttle], car)).all()
    assert (pulses([steering, throttle], car) <= longest).all()


@pytest.mark.parametrize("full", [-1.0, 1.0])
def test_a_command_beyond_full_is_full_also_where_the_hard_limits_are_wider(full):
    limits = {"min_us": 600, "max_us": 2400}
    wide = parse_calibration(changed(steering=limits, throttle=limits), "wide limits")
    assert pulses([full * 2.0, full * 2.0], wide).tolist() == pulses([full, full], wide).tolist()


def test_the_worker_is_told_where_the_motor_rests():
    assert (TT01.throttle.law.dead_zone_us, TT01.steering.law.dead_zone_us) == (TT01.throttle.dead_zone_us, 0.0)
    assert TT01.throttle.dead_zone_us > 0


def test_pulses_within_a_skipped_dead_zone_are_throttle_zero():
    assert action_of([[1567, 1500], [1567, 1560]], TRIMMED).tolist() == [[0, 0], [0, 0]]


def test_a_batch_gives_what_its_rows_give():
    actions = np.linspace(-1, 1, 24).reshape(3, 4, 2)
    assert (pulses(actions, TRIMMED)[2, 1] == pulses(actions[2, 1], TRIMMED)).all()


@pytest.mark.parametrize("bad", [[np.nan, 0], [0, np.inf], [[0, 0], [-np.inf, 0]], [0, 0, 0], 0.0])
def test_what_is_no_command_is_refused(bad):
    with pytest.raises(ConfigError, match="finite numbers: steering, throttle"):
        pulses(bad, TT01)


def test_slew_limit_holds_the_change_of_a_period():
    slow = parse_calibration(changed(steering={"slew_per_s": 8.0}, throttle={"slew_per_s": 4.0}), "slow")
    assert limit_slew([1, -1], [0, 0], 0.0125, slow).tolist() == pytest.approx([0.1, -0.05])


def test_slew_limit_never_delays_throttle_zero():
    slow = parse_calibration(changed(throttle={"slew_per_s": 4.0}), "slow")
    assert limit_slew([[0, 0], [0, -1]], [0, 1], 0.0125, slow).tolist() == [[0, 0], [0, 0]]


def test_a_slew_limit_holds_a_servo_back_on_its_way_to_straight_too():
    slow = parse_calibration(changed(steering={"slew_per_s": 8.0}), "slow servo")
    assert limit_slew([0.0, 0.0], [1.0, 0.0], 0.0125, slow).tolist() == [pytest.approx(0.9), 0.0]


@pytest.mark.parametrize(("steering", "throttle"), [(0, 1), (1, 0), (5, 4), (14, 15)])
def test_two_outputs_side_by_side_are_neighbours(steering, throttle):
    car = parse_calibration(changed(steering={"channel": steering}, throttle={"channel": throttle}), "other outputs")
    assert [channel.output for channel in car.laws] == [steering, throttle]


def test_without_a_slew_limit_commands_pass_exactly():
    assert limit_slew([-0.3, 1], [0.7, -1], 0.0125, TT01).tolist() == [-0.3, 1]


def test_packaged_calibration_is_found_by_name_and_by_path():
    assert packaged_calibrations() == ("tt01",)
    assert load_calibration(PACKAGED / "tt01.json") == load_calibration(str(PACKAGED / "tt01.json")) == TT01
    assert load_calibration(TT01) is TT01


def test_packaged_schema_is_that_of_the_code_and_fits_the_packaged_file():
    schema = json.loads((PACKAGED / "car.schema.json").read_text())
    assert schema == json_schema()
    jsonschema.validate(json.loads((PACKAGED / "tt01.json").read_text()), schema)


def test_all_problems_are_listed_with_their_place():
    text = changed(
        version=2, steering={"left_us": "1240", "trimm_us": 4}, throttle={"min_us": 1200, "neutral_us": 1900}
    )
    with pytest.raises(CalibrationError) as caught:
        parse_calibration(text, "my_car.json")
    message = str(caught.value)
    assert message.startswith("calibration 'my_car.json' cannot be used, 6 problem(s):")
    assert "version: got 2" in message
    assert "steering.left_us: got '1240'" in message
    assert "steering.trimm_us: unknown; did you mean 'trim_us'?" in message
    assert "throttle: command 0 is 1900 us, outside the hard limits 1200 .. 1860 us" in message
    assert "throttle: command +1 is 1140 us, outside the hard limits 1200 .. 1860 us" in message
    assert "throttle: command 0 is 1900 us, not between command -1 = 1860 us and command +1 = 1140 us" in message


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"steering": {"neutral_us": float("nan")}}, "steering.neutral_us: got"),
        ({"steering": {"channel": 4}}, "steering.channel = 4 and throttle.channel = 1 are not neighbours"),
        (
            {"throttle": {"dead_zone_us": 300, "skip_dead_zone": True, "reverse_us": 1860}},
            "only 30 us are left between command 0 and an end",
        ),
        ({"throttle": {"min_us": 1900}}, "min_us = 1900 is not below max_us = 1860"),
        ({"colour": "red"}, "colour: unknown; "),
    ],
)
def test_a_calibration_that_cannot_work_is_refused(change, problem):
    with pytest.raises(CalibrationError) as caught:
        parse_calibration(changed(**change), "x")
    assert problem in str(caught.value)


def test_missing_values_are_named():
    with pytest.raises(CalibrationError, match=r"steering: is missing\n  throttle: is missing"):
        parse_calibration('{"version": 1, "name": "x", "period_us": 17430}', "x")


def test_broken_json_names_line_and_column():
    with pytest.raises(CalibrationError, match=r"x\.json:2:1: not JSON"):
        parse_calibration("{\n", "x.json")


@pytest.mark.parametrize("text", ["[" * 100_000, '{"version": ' + "1" * 5000 + "}"])
def test_json_that_cannot_be_held_is_refused(text):
    with pytest.raises(CalibrationError, match=r"x\.json"):
        parse_calibration(text, "x.json")


def test_unknown_name_and_missing_file_are_refused(tmp_path):
    with pytest.raises(CalibrationError, match="did you mean 'tt01'"):
        load_calibration("tt02")
    with pytest.raises(UnreadableCalibrationError, match=r"calibration '.*none.json': No such file or directory$"):
        load_calibration(tmp_path / "none.json")


def test_a_key_that_stands_twice_is_told_with_its_place():
    text = changed().replace('"steering": {', '"steering": {"trim_us": 5, "trim_us": 6, ', 1)
    with pytest.raises(
        CalibrationError, match=r"'a' cannot be used, 1 problem\(s\):\n  steering.trim_us: is there twice"
    ):
        parse_calibration(text, "a")


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path):
    file = tmp_path / "mine.json"
    file.write_text(changed(), encoding="utf-8-sig")
    assert load_calibration(file) == parse_calibration(changed(), "a")
