"""What a policy takes as an observation, and what it refuses."""

import numpy as np
import pytest

from tral_env.errors import ConfigError
from tral_env.interface import CORE_LAYOUT, Layout
from tral_fsm import load_policy

SIZE = CORE_LAYOUT.size


def observation(n: int, **readings: float) -> np.ndarray:
    return CORE_LAYOUT.pack({"ultrasonic_right": 0.5, "ultrasonic_right_age": 0.065, **readings}, n)


def test_optional_groups_behind_the_core_fields_are_not_looked_at() -> None:
    wide = np.concatenate([observation(1), np.full((1, Layout.of(["imu"]).size - SIZE), 9.0)], axis=1)
    assert (load_policy("wall").act(wide) == load_policy("wall").act(observation(1))).all()


@pytest.mark.parametrize("shape", [(2, SIZE), (SIZE - 1,), (1, 1, SIZE), (0, SIZE)])
def test_a_wrong_shape_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ConfigError, match="observation has shape"):
        load_policy("wall").act(np.zeros(shape, np.float32))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"image": 0, "readings": 0}, "a dict with image, readings.*observation\\['readings'\\]"),
        ((observation(1), {}), "a tuple.*hand over the first"),
        ([0.0] * SIZE, "a list, expected a NumPy array"),
        (np.zeros((1, 4 * SIZE), np.float32), "stacked frames"),
        (np.zeros((120, 160, 3), np.uint8), "an image"),
        (
            observation(1, ultrasonic_left=1.0) - np.float32(1.5),
            "ultrasonic_left = -0.5 m in row 0, allowed 0 to 6 m: .*normalized",
        ),
        (np.full((1, SIZE), np.nan), "ultrasonic_left = nan.*gives NaN"),
        (np.array(1.0), r"shape \(\), expected"),
        (np.zeros((0, SIZE), np.float32), r"shape \(0, "),
    ],
)
def test_what_is_no_observation_is_refused_and_the_error_says_what_was_likely_done(wrong: object, told: str) -> None:
    policy = load_policy("wall")
    for ask in (policy.act, policy.predict):
        with pytest.raises(ConfigError, match=told):
            ask(wrong)


def test_the_bounds_themselves_are_readings() -> None:
    policy = load_policy("wall")
    for bound in (CORE_LAYOUT.space().low, CORE_LAYOUT.space().high):
        assert np.isfinite(policy.act(bound)).all()
