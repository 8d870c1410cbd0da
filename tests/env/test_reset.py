"""A reset leaves nothing behind: the second episode of an environment is that of a fresh one."""

from typing import Any

import numpy as np
import pytest
from corridors import corridor
from numpy.testing import assert_array_equal

from tral_env.errors import ConfigError
from tral_env.interface import OPTIONAL_GROUPS
from tral_env.vector_env import TralCorridorVectorEnv

INTO_THE_WALL = np.array([0.6, 0.6], np.float32)
GROUPS = tuple(OPTIONAL_GROUPS)


def crash(env: Any, seed: int = 2) -> dict[str, Any]:
    """Drive into the wall; the last info."""
    env.reset(seed=seed)
    terminated = False
    while not terminated:
        *_, terminated, _, info = env.step(INTO_THE_WALL)
    return info


def test_info_of_a_reset_after_a_crash_tells_no_collision() -> None:
    env = corridor(scenario="straight", randomization="none")
    assert crash(env)["crash"]
    _, info = env.reset(seed=2)
    assert (info["collision"], info["crash"]) == (False, False)


@pytest.mark.parametrize("level", ["none", "hard"])
def test_an_episode_after_a_crash_is_that_of_a_fresh_environment(level: str) -> None:
    used, fresh = (corridor(scenario="gates", randomization=level, groups=GROUPS) for _ in range(2))
    crash(used)
    (observation, info), (other, expected) = used.reset(seed=5), fresh.reset(seed=5)
    for _ in range(60):
        assert_array_equal(observation, other)
        assert_same(info, expected)
        observation, *ours, info = used.step(INTO_THE_WALL)
        other, *theirs, expected = fresh.step(INTO_THE_WALL)
        assert ours == theirs


def assert_same(info: dict[str, Any], expected: dict[str, Any]) -> None:
    assert set(info) == set(expected)
    for name, value in info.items():
        assert_array_equal(value, expected[name], err_msg=name)


def rows_of(n: int, mode: str) -> TralCorridorVectorEnv:
    return TralCorridorVectorEnv(n, autoreset_mode=mode, scenario="straight", randomization="none", groups=GROUPS)


def drive_row_0_into_the_wall(env: TralCorridorVectorEnv) -> dict[str, Any]:
    """Row 1 stands; the info of the step in which row 0 ends."""
    env.reset(seed=2)
    ended = False
    while not ended:
        *_, terminated, _, info = env.step(np.stack([INTO_THE_WALL, np.zeros(2, np.float32)]))
        ended = bool(terminated[0])
    return info


def test_a_row_that_begins_anew_in_the_step_in_which_it_crashed_tells_no_collision() -> None:
    info = drive_row_0_into_the_wall(rows_of(2, "SameStep"))
    assert info["final_info"]["crash"].tolist() == [True, False]
    assert info["collision"].tolist() == [False, False]
    assert info["crash"].tolist() == [False, False]


def test_a_row_that_begins_anew_in_the_next_step_tells_no_collision() -> None:
    env = rows_of(2, "NextStep")
    assert drive_row_0_into_the_wall(env)["crash"].tolist() == [True, False]
    *_, info = env.step(np.zeros((2, 2)))
    assert info["collision"].tolist() == [False, False]
    assert info["crash"].tolist() == [False, False]


def test_a_row_that_was_reset_by_mask_tells_nothing_of_its_crash() -> None:
    env = rows_of(2, "Disabled")
    assert drive_row_0_into_the_wall(env)["crash"].tolist() == [True, False]
    _, info = env.reset(options={"reset_mask": np.array([True, False])})
    assert info["collision"].tolist() == [False, False]
    assert info["crash"].tolist() == [False, False]


def test_a_row_that_rests_tells_how_it_ended_while_another_is_reset() -> None:
    env = rows_of(2, "Disabled")
    last = drive_row_0_into_the_wall(env)
    env.step(np.zeros((2, 2)))
    _, info = env.reset(options={"reset_mask": np.array([False, True])})
    for name in ("collision", "crash", "success", "missed_gate", "progress", "time_s"):
        assert info[name][0] == last[name][0], name


def test_episodes_may_begin_anywhere_on_their_courses() -> None:
    whole, part = (TralCorridorVectorEnv(4, scenario="corners", anywhere=share) for share in (0.0, 1.0))
    for env in (whole, part):
        env.reset(seed=3)
    for begun, rest in zip(whole.world.plans, part.world.plans, strict=True):
        assert begun is not None
        assert rest is not None
        assert rest.length < begun.length - 0.1
        assert rest.route[-1].tolist() == begun.route[-1].tolist()
        assert rest.box_position.tolist() == begun.box_position.tolist()


@pytest.mark.parametrize(
    ("options", "message"),
    [({"anywhere": 1.5}, "anywhere = 1.5: expected 0 to 1"), ({"anywhere": 0.5, "course": "l_shape"}, "of your own")],
)
def test_a_share_that_cannot_be_is_refused(options: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        TralCorridorVectorEnv(1, **options)
