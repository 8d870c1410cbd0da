"""A car among others, driven by the policy that drives it alone."""

from collections.abc import Iterator
from typing import Any, TypeVar

import numpy as np
import pytest

from tral_env.learned import LearnedPolicy
from tral_env.vector_env import TralCorridorVectorEnv

P = TypeVar("P", bound=LearnedPolicy)


def row_among_others(together: P, alone: P, n: int, scenario: str) -> Iterator[tuple[P, P]]:
    """Drive n cars, and the second one beside them alone; both command the same at each of 400 ticks.

    Some cars begin new episodes on their way. Gives the two policies after each tick, for further questions.
    """
    env = TralCorridorVectorEnv(n, "SameStep", scenario=scenario)
    together.reset(n)
    observation, _ = env.reset(seed=0)
    begun = 0
    for _ in range(400):
        command: Any = together.act(observation)
        assert command[1] == pytest.approx(alone.act(observation[1]), abs=1e-6)
        yield together, alone
        observation, _, terminated, truncated, _ = env.step(command)
        done = terminated | truncated
        together.reset_rows(done)
        begun += np.count_nonzero(done)
        if done[1]:
            alone.reset()
    assert begun
