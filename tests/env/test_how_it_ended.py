"""How an episode has ended, in words."""

import numpy as np
import pytest

from tral_env.world import how_it_ended


@pytest.mark.parametrize(
    ("holds", "ended"),
    [
        ((), "time is up"),
        (("success",), "success"),
        (("collision", "missed_gate"), "collision"),
        (("missed_gate",), "missed gate"),
    ],
)
def test_an_episode_is_told_to_end_by_what_holds_of_one_car_or_of_a_row(holds: tuple[str, ...], ended: str) -> None:
    one = {name: name in holds for name in ("success", "collision", "missed_gate")}
    rows = {name: np.array([False, value]) for name, value in one.items()}
    assert how_it_ended(one) == how_it_ended(rows, row=1) == ended
    assert how_it_ended(rows) == "time is up"
