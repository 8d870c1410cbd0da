"""The built-in contenders: floors that see nothing, a ceiling that knows the truth."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tral_env import task
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, Gate, Segment
from tral_fsm.evaluation.baselines import BASELINES, MAX_ROUTE_SPEED_MPS, along_route, bend_speed
from tral_fsm.evaluation.batch import BatchRunner
from tral_fsm.evaluation.episode import EpisodeRequest, TickRecorder

STRAIGHT = Course(name="straight", segments=(Segment(length=5.0, width=2.0),))
BEND = Course(
    name="bend",
    segments=(
        Segment(length=6.5, width=2.0, then="left", gates=(Gate(id=1, at=3.5, offset=0.25, width=0.7),)),
        Segment(length=4.0, width=2.0),
    ),
)


def driven(name: str, course: Course, *seeds: int) -> tuple[list[str], list[NDArray[np.floating]]]:
    """Outcomes and commands (T, 2) of a baseline's drives."""
    runner = BatchRunner(["mine"], rows=2, course=course)
    recorders = {k: [TickRecorder()] for k in range(len(seeds))}
    got = runner.drive_with(
        BASELINES[name].make, [EpisodeRequest(0, "mine", seed) for seed in seeds], observers=recorders
    )
    return [one.outcome for one in got], [recorder.trace().action for (recorder,) in recorders.values()]


def test_pursuit_drives_through_a_gate_and_around_a_bend() -> None:
    outcomes, _ = driven("pursuit", BEND, 1, 2, 3)
    assert outcomes == ["success"] * 3


def test_constant_never_changes_its_command() -> None:
    _, (commands,) = driven("constant", STRAIGHT, 1)
    assert np.ptp(commands, axis=0).tolist() == [0.0, 0.0]
    assert commands[0].tolist() == [0.0, 0.25]


def test_random_holds_a_command_for_a_tenth_of_a_second_and_uses_the_whole_space() -> None:
    _, (commands,) = driven("random", STRAIGHT, 4)
    whole = commands[: len(commands) // 8 * 8].reshape(-1, 8, 2)
    assert (whole == whole[:, :1]).all()
    assert (np.ptp(whole[:, 0], axis=0) > 1.0).all()


def test_random_draws_the_same_for_a_request_whatever_drove_before() -> None:
    _, three = driven("random", STRAIGHT, 4, 5, 6)
    _, (alone,) = driven("random", STRAIGHT, 6)
    assert (three[2] == alone).all()
    assert (three[0][0] != three[1][0]).all()


@pytest.fixture
def track() -> task.Track:
    track = task.empty_track(2)
    task.lay(track, 0, build_plan(STRAIGHT))
    task.lay(track, 1, build_plan(BEND))
    return track


def test_a_place_on_a_route_is_found_by_its_arc_length(track: task.Track) -> None:
    rows, plan = np.array([0]), build_plan(STRAIGHT)
    (point,), (unit,) = along_route(track, rows, np.array([1.0]))
    assert point == pytest.approx(plan.route[0] + [1.0, 0.0])
    assert unit == pytest.approx([1.0, 0.0])


def test_a_route_goes_straight_on_beyond_its_end(track: task.Track) -> None:
    rows = np.array([0, 1])
    ends, units = along_route(track, rows, track.length)
    beyond, _ = along_route(track, rows, track.length + 0.3)
    assert beyond == pytest.approx(ends + 0.3 * units)


def test_a_bend_ahead_is_driven_slower_than_a_straight(track: task.Track) -> None:
    straight, bend = bend_speed(track, np.array([0, 1]), np.array([0.0, 4.1]))
    assert straight == MAX_ROUTE_SPEED_MPS
    assert 0.5 < bend < 0.9
