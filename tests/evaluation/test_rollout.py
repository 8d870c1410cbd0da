from __future__ import annotations

import json
import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from lane import STEPS, Cruiser, Lane

from tral_env.errors import ConfigError
from tral_env.interface import CORE_LAYOUT
from tral_fsm import load_policy
from tral_fsm.evaluation.episode import Tick
from tral_fsm.evaluation.rollout import drive


class Stateless:
    """A policy as a trained network is one."""

    def reset(self, n: int = 1) -> None:
        pass

    def act(self, observation: np.ndarray) -> np.ndarray:
        return np.array([0.5, 0.5])


@pytest.mark.parametrize("ending", ["success", "collision", "missed_gate", "timeout"])
def test_an_episode_says_how_it_ended(ending: str) -> None:
    episode = drive(Lane(ending), Cruiser(), seed=1)
    assert episode.outcome == ending
    assert episode.success == (ending == "success")
    assert episode.crash == (ending == "collision")


def test_the_figures_are_those_of_the_last_info() -> None:
    episode = drive(Lane(), Cruiser(), seed=1, scenario="lane")
    assert (episode.scenario, episode.seed) == ("lane", 1)
    assert (episode.progress, episode.gates_passed, episode.gates_total) == (1.0, 1, 1)
    assert episode.time_s == pytest.approx(0.125)
    assert episode.mean_speed == pytest.approx(0.5)


def test_the_clearance_error_is_measured_where_there_is_one() -> None:
    episode = drive(Lane(), Cruiser(), seed=1)
    assert episode.clearance_samples == 5
    # Steps 6 to 10: 4, 3, 4, 3, 4 cm.
    assert episode.clearance_rmse == pytest.approx(math.sqrt((3 * 0.04**2 + 2 * 0.03**2) / 5))


def test_the_settled_error_is_that_from_the_first_arrival_on() -> None:
    episode = drive(Lane(), Cruiser(), seed=1)  # within 5 cm from the first measured tick on
    assert (episode.settled_samples, episode.settled_rmse) == (5, episode.clearance_rmse)
    assert episode.record()["settled_rmse_m"] == pytest.approx(0.03633, abs=1e-5)


def test_the_distance_from_the_route_is_measured_always() -> None:
    episode = drive(Lane(), Cruiser(), seed=1)
    # Ten steps, 20 cm and 10 cm in turn.
    assert episode.lateral_rms == pytest.approx(math.sqrt((0.2**2 + 0.1**2) / 2))


def test_without_a_measured_clearance_the_error_is_nan_and_none_in_json() -> None:
    episode = drive(Lane(steps=5), Cruiser(), seed=1)
    assert math.isnan(episode.clearance_rmse)
    assert json.loads(json.dumps(episode.record(), allow_nan=False))["clearance_rmse_m"] is None


def test_the_error_of_a_tick_is_the_true_clearance_minus_the_wish_of_the_policy() -> None:
    ticks: list[Tick] = []
    episode = drive(Lane(), Cruiser(), seed=1, on_step=ticks.append)
    assert [tick.wanted for tick in ticks] == [(1.0, 0.4)] * STEPS
    expected = [math.nan] * 5 + [-0.04, 0.03] * 2 + [-0.04]
    assert [tick.clearance_error for tick in ticks] == pytest.approx(expected, nan_ok=True)
    assert episode.trace.clearance_error == pytest.approx(expected, nan_ok=True)


def test_an_env_that_tells_no_clearance_has_no_error() -> None:
    class Blind(Lane):
        def step(self, action: object) -> Any:
            *others, info = super().step(action)
            return *others, {name: value for name, value in info.items() if not name.startswith("clearance")}

    assert drive(Blind(), Cruiser(), seed=1).clearance_samples == 0


def test_a_watcher_is_told_the_info_as_the_env_tells_it() -> None:
    class Chatty(Lane):
        def step(self, action: object) -> Any:
            *others, info = super().step(action)
            return *others, info | {"note": {"words": ["a", "b"]}}

    ticks: list[Tick] = []
    drive(Chatty(), Cruiser(), seed=1, on_step=ticks.append)
    assert ticks[0].info["note"] == {"words": ["a", "b"]}


def test_steering_travel_is_that_of_commands_within_their_limits() -> None:
    class Weaver(Cruiser):
        def act(self, observation: Any) -> Any:
            super().act(observation)
            return np.array([3.0 if self.k % 2 else -3.0, 0.25], np.float32)

    assert drive(Lane(), Weaver(), seed=1).steering_travel == 1.0 + 2.0 * (STEPS - 1)


def test_the_record_of_an_env_that_tells_no_route_has_none() -> None:
    assert not {"route_m", "steering_travel"} & {*drive(Lane(), Cruiser(), seed=1).record()}


def test_a_row_of_the_trace_has_what_was_seen_and_where_it_led() -> None:
    trace = drive(Lane(), Cruiser(), seed=1).trace
    assert trace.pose.shape == (STEPS, 3)
    assert trace.readings.shape == (STEPS, CORE_LAYOUT.size)
    assert trace.readings[:, CORE_LAYOUT.column("distance")] == pytest.approx(np.arange(STEPS) / 10)
    assert trace.pose[:, 0] == pytest.approx(np.arange(1, STEPS + 1) / 10)
    assert trace.states == ("near",) * 4 + ("far",) * 6


def test_a_policy_without_states_drives_too() -> None:
    trace = drive(Lane(), Stateless(), seed=1).trace
    assert set(trace.states) == {""}
    assert np.isnan(trace.clearance_error).all()
    assert (trace.action == 0.5).all()


def test_every_tick_is_shown_to_the_watcher() -> None:
    ticks: list[Tick] = []
    drive(Lane(), Cruiser(), seed=1, on_step=ticks.append)
    assert [tick.index for tick in ticks] == list(range(STEPS))
    assert ticks[-1].info["success"]


def test_options_reach_the_env() -> None:
    env = Lane()
    drive(env, Cruiser(), seed=1, options={"course": "a.json"})
    assert env.options == {"course": "a.json"}


def test_the_same_seed_gives_the_same_episode() -> None:
    first, again, other = (drive(Lane(), Cruiser(), seed=seed).trace.readings for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_the_same_drive_twice_gives_equal_episodes() -> None:
    first, second = (drive(Lane(), Cruiser(), seed=1) for _ in range(2))
    assert first == second
    assert hash(first) == hash(second)
    assert first != drive(Lane("timeout"), Cruiser(), seed=1)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"action": "speed"}, "made with action='speed', but the policy takes the plain readings.*without it"),
        ({"decision_hz": 10}, "made with decision_hz=10, but"),
        ({"drive_range": (0.0, 0.3)}, r"made with drive_range=\(0\.0, 0\.3\), but"),
        ({"observation": "features", "history": 2}, "observation='features', history=2, .*without these options"),
    ],
)
def test_a_machine_does_not_drive_where_its_command_means_something_else(options: dict[str, Any], told: str) -> None:
    env = gym.make("tral_env:TralCorridor-v0", scenario="straight", **options)
    with pytest.raises(ConfigError, match=told):
        drive(env, load_policy("wall"), seed=0)
    env.close()


@pytest.mark.parametrize("options", [{"decision_hz": 20}, {"observation": "features"}, {"history": 2}])
def test_no_policy_drives_where_figures_and_trace_would_be_of_something_else(options: dict[str, Any]) -> None:
    env = gym.make("tral_env:TralCorridor-v0", scenario="straight", **options)
    with pytest.raises(ConfigError, match=f"made with {next(iter(options))}=.*, but a drive is measured and traced"):
        drive(env, Stateless(), seed=0)
    env.close()


def test_a_policy_of_ones_own_may_command_a_speed() -> None:
    class Slow(Stateless):
        def act(self, observation: np.ndarray) -> np.ndarray:
            return np.array([0.0, -1.0])

    options = {"action": "speed", "drive_range": (0.0, 1.0), "task": {"nominal_speed": 3.0, "grace_s": 0.1}}
    env = gym.make("tral_env:TralCorridor-v0", scenario="straight", randomization="none", **options)
    assert drive(env, Slow(), seed=0).mean_speed == pytest.approx(0.0, abs=0.01)
    env.close()
