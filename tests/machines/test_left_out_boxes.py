"""A machine drives on the same readings whichever boxes its physics leaves out."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from tral_env.options import CorridorConfig
from tral_env.simulation import culling
from tral_env.world import World
from tral_fsm import load_policy


@pytest.mark.parametrize("scenario", ["office", "doors"])
def test_no_reading_shows_which_boxes_are_left_out(scenario: str, monkeypatch: pytest.MonkeyPatch):
    rows, ticks = 3, 1000

    def drive() -> list[np.ndarray]:
        world, policy = World(rows, CorridorConfig(scenario=scenario)), load_policy("office")
        world.reset(world.request(np.arange(rows)), [np.random.default_rng(seed) for seed in range(rows)])
        policy.reset(rows)
        seen = [world.observation()]
        for _ in range(ticks):
            seen.append(world.step(policy.act(seen[-1])).observation)
        return seen

    near = drive()
    monkeypatch.setattr(culling, "LOCAL_BOXES", 1000)
    assert_array_equal(np.stack(near), np.stack(drive()))
