"""On a real computer a tick comes late, and the next one soon after it: an old reading must not count as new then."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.interface import CORE_LAYOUT, MAX_AGE_S
from tral_fsm.estimation.estimator import Estimator
from tral_fsm.estimation.sonar import is_new

GAPS_S = st.lists(st.floats(0.0005, 0.03), min_size=40, max_size=120)


@given(GAPS_S)
def test_a_reading_that_stays_is_new_once(gaps_s: list[float]) -> None:
    estimator, age, news = Estimator(), 0.02, []
    for gap_s in gaps_s:
        row = CORE_LAYOUT.pack({"ultrasonic_left": 1.0, "ultrasonic_left_age": age}, 1)[0].tolist()
        news.append(estimator.update(row).left.new)
        age += gap_s
    assert news == [True] + [False] * (len(news) - 1)


@given(st.lists(st.floats(0.001, 0.03), min_size=10, max_size=60), st.floats(0.06, 0.08))
def test_a_sensor_that_fires_again_and_again_tells_each_firing_once(gaps_s: list[float], period_s: float) -> None:
    now_s, fired_s, told = 0.0, 0.0, 0
    before = MAX_AGE_S
    for gap_s in gaps_s:
        now_s += gap_s
        fired_s += period_s * ((now_s - fired_s) // period_s)
        told += is_new(now_s - fired_s, before)
        before = now_s - fired_s
    assert told == round(fired_s / period_s) + 1


@pytest.mark.parametrize("gap_s", [0.001, 0.005, 0.0125, 0.02])
def test_a_gate_that_is_out_of_view_stays_where_it_was(gap_s: float) -> None:
    """An image that counts again after the end of the history would be placed too far on."""
    estimator, distance = Estimator(), 0.0
    for _ in range(3):
        seen = {"gate_id": 1.0, "gate_x": 3.0 - distance, "gate_age": 0.03, "distance": distance, "speed": 0.5}
        estimate = estimator.update(CORE_LAYOUT.pack(seen, 1)[0].tolist())
        distance += 0.5 * 0.0667
    where = estimate.gate.x
    age = 0.03
    while age < 8.0:
        age, distance = age + gap_s, distance + 0.5 * gap_s
        seen = {"gate_id": 1.0, "gate_x": 3.0 - 2 * 0.5 * 0.0667, "gate_age": age, "distance": distance, "speed": 0.5}
        estimate = estimator.update(CORE_LAYOUT.pack(seen, 1)[0].tolist())
        assert not estimate.gate.new
    assert estimate.gate.x == where
