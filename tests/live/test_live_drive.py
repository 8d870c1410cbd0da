"""The drive behind the page: it drives as `tral drive` does, and obeys between two ticks."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
import pytest
from numpy.typing import NDArray

from tral_env.errors import ConfigError
from tral_env.interface import CONTROL_PERIOD_S, MAX_AGE_S
from tral_fsm import MachinePolicy, load_machine, load_policy
from tral_fsm.evaluation.rollout import drive
from tral_fsm.live.drive import LiveDrive
from tral_fsm.live.frame import Course
from tral_fsm.live.numbers import nulls
from tral_fsm.live.pace import Clock, Pace


class Hand:
    """Time that passes by sleeping alone."""

    def __init__(self) -> None:
        self.s = 0.0
        self.clock = Clock(lambda: self.s, self._sleep)

    def _sleep(self, seconds: float) -> None:
        self.s += seconds


COURSE = Course(scenario="corners", seed=3)


@pytest.fixture
def live() -> Iterator[LiveDrive]:
    drive = LiveDrive(COURSE, ["corners"], clock=Hand().clock)
    drive.shows_camera = False
    yield drive
    drive.close()


def turns(live: LiveDrive, count: int) -> None:
    for _ in range(count):
        live.turn()


def test_it_drives_bit_for_bit_as_without_a_page(live: LiveDrive) -> None:
    env = gym.make("tral_env:TralCorridor-v0", scenario="corners")
    episode = drive(env, load_policy("corners"), 3)
    env.close()
    poses = []
    while not live.frame.cars[0].ended:
        live.turn()
        poses.append(live.lanes[0].frame().pose)
    assert episode.trace is not None
    assert np.array_equal(np.array(poses), episode.trace.pose)
    assert live.frame.cars[0].ended == "arrived"


def test_a_frame_does_not_change_any_more(live: LiveDrive) -> None:
    frame = live.lanes[0].frame()
    before = frame.qpos.copy(), dict(frame.readings), frame.pose
    turns(live, 50)
    assert np.array_equal(frame.qpos, before[0])
    assert (dict(frame.readings), frame.pose) == before[1:]


def test_a_number_holds_from_the_next_tick_on(live: LiveDrive) -> None:
    turns(live, 120)
    before = live.lanes[0].frame()
    assert (before.state, before.wanted_mps > 0.3) == ("follow", True)
    live.order(lambda drive: drive.lanes[0].retune("state[follow].speed", 0.3))
    live.turn()
    policy = live.lanes[0].policy
    assert isinstance(policy, MachinePolicy)
    assert policy.definition != load_machine("corners")
    assert live.lanes[0].frame().wanted_mps <= 0.3
    live.order(lambda drive: drive.lanes[0].retune_all())
    live.turn()
    assert policy.definition == load_machine("corners")


def test_a_value_that_is_not_allowed_is_told_and_the_drive_goes_on(live: LiveDrive) -> None:
    live.order(lambda drive: drive.lanes[0].retune("state[follow].speed", -1.0))
    turns(live, 3)
    assert "speed" in live.frame.notice
    assert live.lanes[0].frame().time_s == pytest.approx(3 * CONTROL_PERIOD_S)


def test_it_stands_while_it_is_paused_and_steps_on_demand(live: LiveDrive) -> None:
    turns(live, 10)
    live.order(lambda drive: drive.pause(True))
    turns(live, 20)
    assert live.frame.paused
    assert live.frame.cars[0].time_s == pytest.approx(10 * CONTROL_PERIOD_S)
    live.order(lambda drive: drive.step(4))
    turns(live, 20)
    assert live.frame.cars[0].time_s == pytest.approx(14 * CONTROL_PERIOD_S)


def test_a_restart_gives_the_same_drive(live: LiveDrive) -> None:
    turns(live, 200)
    first = live.lanes[0].frame().pose
    live.order(lambda drive: drive.restart())
    turns(live, 200)
    assert live.lanes[0].frame().pose == first
    assert live.frame.episode == 2


def test_another_seed_and_another_course(live: LiveDrive) -> None:
    before = live.frame.plan
    live.order(lambda drive: drive.choose(seed=4))
    live.turn()
    assert live.frame.plan is not before
    live.order(lambda drive: drive.choose(course="ring"))
    live.turn()
    assert live.frame.title.startswith("ring")


def test_a_course_that_does_not_exist_leaves_the_old_one(live: LiveDrive) -> None:
    before = live.frame.plan
    live.order(lambda drive: drive.choose(course="nowhere"))
    live.turn()
    assert "nowhere" in live.frame.notice
    assert live.frame.plan is before


def test_a_seed_below_zero_leaves_the_old_one(live: LiveDrive) -> None:
    before = live.frame.plan
    live.order(lambda drive: drive.choose(seed=-1))
    live.turn()
    assert "seed -1" in live.frame.notice
    assert live.course == COURSE
    assert live.frame.plan is before


def test_an_ultrasonic_that_was_taken_away_grows_old(live: LiveDrive) -> None:
    turns(live, 100)
    live.order(lambda drive: drive.lanes[0].silence("front", True))
    live.turn()
    before = live.lanes[0].frame().readings
    turns(live, 30)
    after = live.lanes[0].frame().readings
    assert after["ultrasonic_front"] == before["ultrasonic_front"]
    assert after["ultrasonic_front_age"] == pytest.approx(before["ultrasonic_front_age"] + 30 * CONTROL_PERIOD_S)
    assert after["ultrasonic_front_age"] <= MAX_AGE_S
    assert live.lanes[0].frame().silent == ("front",)


def test_the_watch_stops_a_car_whose_ultrasonic_is_gone(live: LiveDrive) -> None:
    turns(live, 160)
    live.order(lambda drive: drive.lanes[0].silence("right", True))
    turns(live, 160)
    assert live.lanes[0].frame().state.startswith("stopped")


def test_a_push_moves_the_car(live: LiveDrive) -> None:
    turns(live, 80)
    before = live.lanes[0].world.sim.physics.qvel[0, :2].copy()
    live.lanes[0].push(0.0, 0.5)
    change = live.lanes[0].world.sim.physics.qvel[0, :2] - before
    assert np.hypot(*change) == pytest.approx(0.5)


def test_friction_changes_while_it_drives(live: LiveDrive) -> None:
    live.order(lambda drive: drive.lanes[0].change(friction=0.3))
    turns(live, 2)
    tyres = live.lanes[0].world.sim.physics.handles.tyres
    assert live.lanes[0].world.sim.physics.geom["geom_friction"][0, tyres, 0] == pytest.approx(0.3)
    live.order(lambda drive: drive.lanes[0].change(mass_scale=2.0))
    live.turn()
    assert "mass_scale" in live.frame.notice


def test_the_driver_changes_in_the_middle(live: LiveDrive) -> None:
    turns(live, 100)
    live.order(lambda drive: drive.lanes[0].take_driver("wall"))
    turns(live, 2)
    assert live.frame.cars[0].name == "wall"
    assert live.frame.cars[0].time_s == pytest.approx(102 * CONTROL_PERIOD_S)
    assert live.frame.machine == load_machine("wall")
    live.order(lambda drive: drive.lanes[0].take_driver("student"))
    turns(live, 2)
    assert live.frame.machine is None


def test_two_policies_drive_the_same_course_with_the_same_car() -> None:
    live = LiveDrive(COURSE, ["corners", "office"], clock=Hand().clock)
    live.shows_camera = False
    alone = LiveDrive(COURSE, ["corners"], clock=Hand().clock)
    alone.shows_camera = False
    turns(live, 200)
    turns(alone, 200)
    first, second = (lane.frame() for lane in live.lanes)
    assert first.pose == alone.lanes[0].frame().pose
    assert first.pose != second.pose
    assert live.lanes[0].parameters() == live.lanes[1].parameters()
    live.close()
    alone.close()


def test_an_unknown_policy_is_refused_and_the_old_one_drives_on(live: LiveDrive) -> None:
    live.order(lambda drive: drive.lanes[0].take_driver("nobody"))
    live.turn()
    assert "nobody" in live.frame.notice
    assert live.frame.cars[0].name == "corners"
    with pytest.raises(ConfigError):
        Course(scenario="nowhere")


FAILING = """
class Failing:
    {where}
        self.ticks = getattr(self, "ticks", 0) + 1
        if self.ticks > 3:
            {how}
        return {answer}
{rest}
"""
ACTS = {"where": "def act(self, observation):", "answer": "(0.0, 0.0)", "rest": ""}
TELLS = {
    "where": "@property\n    def active_states(self):",
    "answer": "['on']",
    "rest": "    def act(self, observation):\n        return (0.0, 0.0)",
}


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        (ACTS | {"how": "raise RuntimeError('no idea')"}, "RuntimeError: no idea (own.py, line 6)"),
        (ACTS | {"how": "raise SystemExit(3)"}, "SystemExit: 3"),
        (ACTS | {"how": "return 'left'"}, ": answered 'left': expected two"),
        (TELLS | {"how": "raise KeyError('x')"}, "KeyError: 'x' (own.py, line 7)"),
    ],
)
def test_a_driver_that_fails_pauses_the_drive_and_another_one_goes_on(
    tmp_path: Path, code: dict[str, str], reason: str
) -> None:
    own, told = tmp_path / "own.py", []
    own.write_text(FAILING.format(**code))
    live = LiveDrive(COURSE, [f"{own}:Failing"], clock=Hand().clock, warn=told.append)
    turns(live, 40)
    assert len(told) == 1
    assert told[0].startswith(f"driver {own}:Failing failed at 0.")
    assert reason in told[0]
    assert "\n" not in told[0]
    assert (live.frame.paused, live.frame.cars[0].ended) == (True, told[0])
    failed_s = live.frame.cars[0].time_s
    live.order(lambda drive: drive.lanes[0].take_driver("corners"))
    live.order(lambda drive: drive.pause(False))
    turns(live, 3)
    assert live.frame.cars[0].ended == ""
    assert live.lanes[0].frame().time_s == pytest.approx(failed_s + 3 * CONTROL_PERIOD_S)
    live.close()


REFUSING = """
class Refusing:
    resets = 0
    def reset(self):
        self.resets += 1
        if self.resets > 2:  # as it takes the car over, and at the start
            raise RuntimeError("not again")
    def act(self, observation):
        return (0.0, 0.3)
"""


def test_a_driver_that_fails_as_the_drive_begins_anew_pauses_it_at_the_start(tmp_path: Path) -> None:
    own, told = tmp_path / "own.py", []
    own.write_text(REFUSING)
    live = LiveDrive(COURSE, [f"{own}:Refusing"], clock=Hand().clock, warn=told.append)
    turns(live, 10)
    live.order(lambda drive: drive.restart())
    turns(live, 3)
    assert told == [f"driver {own}:Refusing failed at 0.00 s: RuntimeError: not again (own.py, line 7)"]
    assert (live.frame.paused, live.frame.episode, live.frame.cars[0].time_s) == (True, 2, 0.0)
    live.order(lambda drive: drive.lanes[0].take_driver("corners"))
    live.order(lambda drive: drive.pause(False))
    turns(live, 3)
    assert live.lanes[0].frame().time_s == pytest.approx(3 * CONTROL_PERIOD_S)
    live.close()


class Counted:
    """A policy that counts its resets, and refuses some."""

    resets: ClassVar[list[str]] = []

    def __init__(self, name: str) -> None:
        self.name = name

    def reset(self, n: int = 1) -> None:
        self.resets.append(self.name)
        if self.resets.count(self.name) > 1 and self.name == "refuses":
            raise RuntimeError("not again")

    def act(self, observation: NDArray[np.floating]) -> NDArray[np.float32]:
        return np.zeros(2, np.float32)


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Environments that were made and are open still."""
    found: list[Any] = []
    make = gym.make

    def made(*args: Any, **options: Any) -> Any:
        env = make(*args, **options)
        found.append(env)
        close = env.close
        monkeypatch.setattr(env, "close", lambda: (found.remove(env), close()))
        return env

    monkeypatch.setattr(gym, "make", made)
    monkeypatch.setattr(Counted, "resets", [])
    return found


def test_what_cannot_be_driven_leaves_nothing_open_and_the_old_one_drives_on(opened: list[Any]) -> None:
    def find(name: str) -> Any:
        if name == "nobody":
            raise ConfigError("nobody drives")
        return Counted(name)

    live = LiveDrive(COURSE, ["one"], clock=Hand().clock, find=find)
    first = list(opened)
    for drivers in (["two", "nobody"], ["two", "refuses"]):
        live.order(lambda drive, drivers=drivers: drive.drive_with(drivers))
        turns(live, 2)
        assert live.frame.notice
        assert [car.name for car in live.frame.cars] == ["one"]
        assert opened == first
    with pytest.raises(ConfigError, match="nobody"):
        LiveDrive(COURSE, ["two", "nobody"], clock=Hand().clock, find=find)
    assert opened == first
    live.close()
    assert opened == []


def test_new_cars_are_put_at_the_start_once(opened: list[Any]) -> None:
    live = LiveDrive(COURSE, ["one"], clock=Hand().clock, find=Counted)
    Counted.resets.clear()
    live.drive_with(["two"])
    assert Counted.resets == ["two", "two"]  # as it takes the car over, and at the start
    assert live.frame.episode == 2
    live.close()


def test_the_best_drive_of_a_course_drives_along_as_a_ghost(live: LiveDrive) -> None:
    assert live.frame.ghost is None
    poses = []
    for _ in range(400):
        live.turn()
        poses.append(live.lanes[0].place()[0])
    live.restart()
    turns(live, 40)
    assert live.frame.ghost is not None
    assert live.frame.ghost.pose in poses[20:41]
    assert live.frame.ghost.name.startswith("corners, ")
    live.restart()  # the shorter drive is no better one
    turns(live, 400)
    assert live.frame.ghost is not None
    assert live.frame.ghost.pose == pytest.approx(poses[399], abs=0.1)
    live.choose(seed=4)
    assert live.frame.ghost is None


def test_a_number_that_is_null_in_the_file_gets_a_value_and_is_null_again(live: LiveDrive) -> None:
    path = "state[settle].unsure_speed"
    live.lanes[0].retune(path, 0.5)
    turns(live, 20)
    machine = live.frame.machine
    assert machine is not None
    assert path not in nulls(machine)
    live.lanes[0].retune(path, None)
    turns(live, 20)
    assert live.frame.machine == load_machine("corners")
    assert live.frame.cars[0].ended == ""


def test_the_pace_is_real_time_and_tells_when_it_is_not_kept() -> None:
    hand = Hand()
    pace = Pace(hand.clock)
    for _ in range(400):
        pace.wait()
    assert hand.s == pytest.approx(399 * CONTROL_PERIOD_S)
    assert pace.told == ""
    for _ in range(400):
        pace.wait()
        hand.s += 2 * CONTROL_PERIOD_S
    assert "0.5" in pace.told
    assert pace.worst_s > 0.0


def test_a_slower_clock_and_no_clock() -> None:
    hand = Hand()
    pace = Pace(hand.clock)
    pace.speed = 0.5
    pace.restart()
    for _ in range(81):
        pace.wait()
    assert hand.s == pytest.approx(2.0)
    pace.speed = math.inf
    pace.restart()
    for _ in range(1000):
        pace.wait()
    assert hand.s == pytest.approx(2.0)
    assert pace.told == ""


@pytest.mark.parametrize(
    ("info", "told"),
    [
        ({"success": True}, "arrived"),
        ({"collision": True}, "touched something"),
        ({"collision": True, "crash": True}, "crash"),
        ({"missed_gate": True}, "missed gate"),
        ({}, "time is up"),
    ],
)
def test_a_lane_tells_how_its_drive_ended(
    info: dict[str, bool], told: str, live: LiveDrive, monkeypatch: pytest.MonkeyPatch
) -> None:
    (lane,) = live.lanes
    step = lane.env.step
    ended = dict.fromkeys(("success", "collision", "crash", "missed_gate"), False) | info

    def last(action: Any) -> Any:
        observation, reward, _, _, before = step(action)
        return observation, reward, True, False, before | ended

    monkeypatch.setattr(lane.env, "step", last)
    lane.start(3)
    lane.tick()
    assert lane.ended == told
