"""When readings arrive, how old they are, and that noise belongs to its row."""

import numpy as np
import pytest

from tral_env.errors import ConfigError
from tral_env.perception.camera_pipeline import CameraPipeline
from tral_env.perception.gate import Detection
from tral_env.randomization import LEVELS, Randomization, level
from tral_env.sensors.ranging import Ranging

ROW = np.array([0])


def sighting(gate: float, marker: float, x: float = 1.0) -> Detection:
    one, none = np.array([x]), np.array([0.0])
    return Detection(np.array([gate]), one, none, none, np.array([marker]), one, none, none)


def test_a_range_is_published_when_the_next_ranging_begins() -> None:
    ranging = Ranging(1)
    ranging.reset(ROW, np.array([[1.0, 2.0, 3.0]]))
    ranging.fire(ROW, np.array([1]), np.array([2.5]), np.array([0.065]))
    assert ranging.range_m[0].tolist() == [1.0, 2.0, 3.0]
    ranging.fire(ROW, np.array([1]), np.array([2.6]), np.array([0.130]))
    assert ranging.range_m[0].tolist() == [1.0, 2.5, 3.0]
    told = ranging.readings(np.array([0.13]))
    ages = [told[f"ultrasonic_{side}_age"] for side in ("left", "front", "right")]
    assert ages == pytest.approx([0.13, 0.065, 0.13])


def test_an_image_is_known_after_its_latency_and_grows_old() -> None:
    eyes = CameraPipeline(1, rate_hz=15.0)
    eyes.reset(ROW, np.array([0.05]))
    assert eyes.trigger(ROW, np.array([0.0])).tolist() == [0]
    eyes.expose(ROW, np.array([0.0]), sighting(3.0, 7.0))
    eyes.deliver(np.array([0.0375]))
    assert eyes.readings(np.array([0.0375]))["gate_id"] == -1.0
    eyes.deliver(np.array([0.05]))
    seen = eyes.readings(np.array([0.0625]))
    assert (seen["gate_id"], seen["marker_id"], seen["gate_age"]) == (3.0, 7.0, 0.0625)


@pytest.mark.parametrize("rate_hz", [15.0, 60.0])
def test_images_of_a_slow_camera_arrive_one_by_one(rate_hz: float) -> None:
    eyes = CameraPipeline(1, rate_hz)
    eyes.reset(ROW, np.array([0.4]))
    ages = []
    for time_s in np.arange(160)[:, None] * 0.0125:
        if len(eyes.trigger(ROW, time_s)):
            eyes.expose(ROW, time_s, sighting(3.0, 7.0))
        eyes.deliver(time_s)
        ages.append(eyes.readings(time_s)["gate_age"])
    assert max(ages[33:]) <= 0.4 + 1 / rate_hz + 0.0125 + 1e-9


def test_a_camera_of_15_hz_exposes_15_images_a_second() -> None:
    eyes = CameraPipeline(1, rate_hz=15.0)
    images = sum(len(eyes.trigger(ROW, np.array([tick * 0.0125]))) for tick in range(800))
    assert images == 150


def test_an_empty_image_does_not_forget_what_was_seen() -> None:
    eyes = CameraPipeline(1, rate_hz=15.0)
    eyes.expose(ROW, np.array([0.0]), sighting(3.0, 7.0))
    eyes.deliver(np.array([0.1]))
    eyes.expose(ROW, np.array([0.1]), sighting(-1.0, 8.0, x=2.0))
    eyes.deliver(np.array([0.2]))
    seen = eyes.readings(np.array([0.2]))
    assert (seen["gate_id"], seen["gate_x"], seen["gate_age"]) == (3.0, 1.0, pytest.approx(0.2))
    assert (seen["marker_id"], seen["marker_x"], seen["marker_age"]) == (8.0, 2.0, pytest.approx(0.1))


def test_every_draw_lies_in_its_range() -> None:
    hard = LEVELS["hard"]
    for seed in range(50):
        for name, value in hard.draw(np.random.default_rng(seed)).items():
            low, high = getattr(hard, name)
            assert low <= value <= high


def test_fixing_one_parameter_leaves_the_draws_of_the_others() -> None:
    free = LEVELS["default"].draw(np.random.default_rng(3))
    fixed = LEVELS["default"].fixed(friction=0.5).draw(np.random.default_rng(3))
    assert fixed.pop("friction") == 0.5
    free.pop("friction")
    assert fixed == free


def test_bad_ranges_and_names_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"friction = \(2\.0, 1\.0\)"):
        Randomization(friction=(2.0, 1.0))
    with pytest.raises(ConfigError, match="did you mean 'friction'"):
        LEVELS["none"].fixed(fricton=0.5)
    with pytest.raises(ConfigError, match="did you mean 'default'"):
        level("defaut")
