"""What a sampler asks for, and which trials are the front of several objectives."""

import pytest
from courses import TWO_WALLS, blind

from tral_env.errors import ConfigError
from tral_fsm.tuning.objective import Weights
from tral_fsm.tuning.parameters import find
from tral_fsm.tuning.search.cma_es import CmaSearch
from tral_fsm.tuning.search.optuna import front, objective_costs
from tral_fsm.tuning.search.space import Trial

CRASHING = blind(0.5, 1.0)
PARAMS = ["0.steering=0.3:0.9", "0.speed=0.8:1.6"]


def trial(values: tuple[float, ...], cost: float, parts: tuple[float, ...] = (0, 0, 0, 0, 0)) -> Trial:
    return Trial(values=values, cost=cost, full=True, drives=1, successes=1, parts=parts)


def test_cma_begins_at_the_machine_and_goes_where_it_is_cheap() -> None:
    parameters = find(CRASHING, PARAMS)
    cma = CmaSearch(parameters, seed=3)
    for _ in range(25):
        asked = cma.ask()
        assert all(0.3 <= float(a) <= 0.9 and 0.8 <= float(b) <= 1.6 for a, b in asked)
        cma.tell([trial(each, (float(each[0]) - 0.72) ** 2 + (float(each[1]) - 1.5) ** 2) for each in asked])
    best = min(asked, key=lambda each: abs(float(each[0]) - 0.72) + abs(float(each[1]) - 1.5))
    assert best == pytest.approx((0.72, 1.5), abs=0.02)


def test_cma_begins_anew_with_twice_the_population_when_it_rests() -> None:
    cma = CmaSearch(find(CRASHING, PARAMS), population=6)
    sizes = set()
    for _ in range(120):
        asked = cma.ask()
        sizes.add(len(asked))
        cma.tell([trial(each, (float(each[0]) - 0.6) ** 2) for each in asked])
    assert {6, 12} <= sizes


def test_one_parameter_can_be_searched() -> None:
    asked = CmaSearch(find(CRASHING, PARAMS[:1])).ask()
    assert all(len(each) == 1 for each in asked)


def test_cma_refuses_what_is_no_real_number() -> None:
    with pytest.raises(ConfigError, match=r"state\[right\].side is a choice of .*: --sampler tpe"):
        CmaSearch(find(TWO_WALLS, ["right.side"]))


def test_the_front_holds_what_nothing_beats() -> None:
    a, b, c = (trial((k,), 0, (0, 0, *costs)) for k, costs in enumerate([(0.01, 3, 0), (0.02, 1, 0), (0.03, 2, 0)]))
    failing = trial((9.0,), 0, (0.5, 0.2, 0, 0, 0))
    assert front([c, b, a, failing], ("clearance", "time")) == [a, b]


def test_failed_drives_weigh_the_same_in_the_search_and_in_the_front() -> None:
    failing = trial((9.0,), 0, (0.5, 0.25, 0.1, 2.0, 0))
    weights = Weights(failure=4.0, unfinished=8.0, clearance=10.0, time=0.5)
    assert objective_costs(failing, ("clearance", "time"), weights) == (1.0 + 4.0, 1.0 + 4.0)
    cheap = Weights(failure=0.0, unfinished=0.0)
    assert front([failing, trial((1.0,), 0, (0, 0, 0.2, 3.0, 0))], ("clearance", "time"), cheap) == [failing]


def test_choices_and_whole_numbers_are_searched() -> None:
    pytest.importorskip("optuna")
    from tral_fsm.tuning.search.optuna import OptunaSearch

    names = ["right.side", "transition[end].of[0].readings", "left.p"]
    asked = OptunaSearch(find(TWO_WALLS, names), "tpe", population=20).ask()
    assert asked[0] == ("right", 2, 3.0)  # the machine's own values come first
    assert {each[0] for each in asked} == {"left", "right"}
    assert all(isinstance(each[1], int) for each in asked)
