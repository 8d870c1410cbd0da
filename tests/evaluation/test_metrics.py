"""What an episode is judged by."""

import numpy as np
import pytest

from tral_fsm.evaluation.metrics import clearance_error


def test_the_clearance_error_is_that_of_the_followed_wall() -> None:
    wanted = np.array([[1.0, 0.5], [-1.0, 0.5], [np.nan, np.nan]])
    error = clearance_error(np.full(3, 0.6), np.full(3, 1.2), wanted)
    assert error[:2].tolist() == pytest.approx([0.1, 0.7])
    assert np.isnan(error[2])
