"""Steps are counted by hand: a row that only resets does not count, and turns alternate."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from tral_fsm.bench.environments import counting
from tral_fsm.bench.timing import Contestant, take_turns


class Short(gym.Env[Any, Any]):
    """An episode of a fixed number of steps."""

    observation_space = gym.spaces.Box(0.0, 1.0)
    action_space = gym.spaces.Box(0.0, 1.0)

    def __init__(self, length: int) -> None:
        self.length, self.left, self.steps = length, 0, 0

    def reset(self, **_: Any) -> tuple[Any, dict[str, Any]]:
        self.left = self.length
        return np.zeros(1, np.float32), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.left, self.steps = self.left - 1, self.steps + 1
        return np.zeros(1, np.float32), 0.0, self.left == 0, False, {}


def test_a_row_that_only_resets_does_not_count() -> None:
    rows = [Short(2), Short(3)]
    env = gym.vector.SyncVectorEnv([lambda: rows[0], lambda: rows[1]])
    step = counting(env, lambda: np.zeros((2, 1), np.float32))
    # The first row drives, drives, resets; the second one drives, drives, drives, resets.
    counted = [step() for _ in range(8)]
    assert counted == [2, 2, 1, 1, 2, 1, 2, 1]
    assert sum(counted) == rows[0].steps + rows[1].steps
    env.close()


def test_contestants_take_turns_and_the_warm_up_does_not_count() -> None:
    log: list[str] = []

    def contestant(name: str) -> Contestant:
        def step() -> int:
            log.append(name)
            return 3

        return Contestant(
            name=name, step=step, begin=lambda: log.append(f"{name} begins"), close=lambda: log.append(f"{name} ends")
        )

    turns: list[str] = []
    both = [contestant("a"), contestant("b")]
    take_turns(both, rounds=2, seconds=0.0, on_turn=turns.append)
    a, b = ["a begins", "a"], ["b begins", "b"]
    assert log == [*a, *b, *a, *b, *a, *b, "a ends", "b ends"]
    assert turns == ["a", "b", "a", "b"]
    assert [len(each.wall) for each in both] == [2, 2]


def test_the_time_of_a_step_is_that_of_the_median_round() -> None:
    assert Contestant(name="x", step=lambda: 1, wall=[1.0, 4.0, 400.0]).seconds_per_step == pytest.approx(0.25)


def test_contestants_are_closed_after_an_error_too() -> None:
    closed: list[str] = []

    def fails() -> int:
        raise ValueError("no step")

    both = [
        Contestant(name="a", step=lambda: 1, close=lambda: closed.append("a")),
        Contestant(name="b", step=fails, close=lambda: closed.append("b")),
    ]
    with pytest.raises(ValueError, match="no step"):
        take_turns(both, rounds=1, seconds=0.0)
    assert sorted(closed) == ["a", "b"]
