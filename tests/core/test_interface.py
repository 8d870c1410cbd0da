"""The waist: fields, packing, spaces."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tral_env.errors import ConfigError
from tral_env.interface import CORE_LAYOUT, OPTIONAL_GROUPS, Layout, action_space, check_readings


def test_nothing_seen_lies_within_the_bounds_of_every_field() -> None:
    layout = Layout.of(OPTIONAL_GROUPS)
    assert layout.space().contains(layout.missing(1)[0].astype(np.float32))


def test_what_is_packed_comes_back_by_name() -> None:
    values = {name: np.array([0.25, 0.5]) for name in CORE_LAYOUT.names}
    unpacked = CORE_LAYOUT.unpack(CORE_LAYOUT.pack(values, 2))
    assert set(unpacked) == set(CORE_LAYOUT.names)
    for name in CORE_LAYOUT.names:
        assert unpacked[name].tolist() == [0.25, 0.5]


def test_readings_beyond_the_bounds_are_clipped() -> None:
    packed = CORE_LAYOUT.pack({"speed": np.array([9.0])}, 1)
    assert CORE_LAYOUT.unpack(packed)["speed"][0] == 5.0


def test_a_reading_that_is_not_named_is_nothing_seen() -> None:
    assert CORE_LAYOUT.unpack(CORE_LAYOUT.pack({}, 1))["gate_id"][0] == -1.0


def test_groups_stand_behind_the_core_fields() -> None:
    layout = Layout.of(("imu", "line"))
    assert layout.names[: CORE_LAYOUT.size] == CORE_LAYOUT.names
    assert layout.names[CORE_LAYOUT.size :][0] == "imu_gyro_x"
    assert layout.fields[-2].meaning == "acceleration with gravity along z"
    assert layout.names[-1] == "line"


def test_unknown_names_are_answered_with_the_nearest() -> None:
    with pytest.raises(ConfigError, match="did you mean 'ultrasonic_left'"):
        CORE_LAYOUT.column("ultrasonic_lef")
    with pytest.raises(ConfigError, match="did you mean 'imu'"):
        Layout.of(("imuu",))


def test_an_observation_of_the_wrong_width_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"shape \(3,\), expected \(\.\.\., 20\)"):
        CORE_LAYOUT.unpack(np.zeros(3))


def test_a_list_is_unpacked_as_an_array_is() -> None:
    assert CORE_LAYOUT.unpack([0.5] * CORE_LAYOUT.size)["speed"] == 0.5


@pytest.mark.parametrize(
    ("needed", "told"),
    [
        ("distance", "needed_readings = 'distance': expected names in a set"),
        (5, "needed_readings = 5: expected names in a set"),
        ({"distanc"}, "unknown reading 'distanc': did you mean 'distance'"),
    ],
)
def test_needed_readings_that_are_no_names_of_readings_are_refused(needed: object, told: str) -> None:
    policy: Any = SimpleNamespace(needed_readings=needed)
    car = SimpleNamespace(provided_readings=frozenset({"speed"}))
    with pytest.raises(ConfigError, match=told):
        check_readings(policy, car)


def test_the_table_names_every_field_once() -> None:
    table = CORE_LAYOUT.table()
    assert all(table.count(f"| `{name}` |") == 1 for name in CORE_LAYOUT.names)


def test_the_action_is_steering_and_throttle() -> None:
    assert action_space().shape == (2,)
    assert action_space().low.tolist() == [-1.0, -1.0]
