"""A recording in the page."""

from __future__ import annotations

import gymnasium as gym
import pytest
from browser import Browser

from tral_env.errors import BadFileError
from tral_env.recording.read import Recording, read
from tral_fsm import load_policy
from tral_fsm.evaluation.policy_files import files_of_policy
from tral_fsm.evaluation.recording import DriveRecorder
from tral_fsm.evaluation.rollout import drive
from tral_fsm.live.page import Page
from tral_fsm.live.replay import Replay


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    path = tmp_path_factory.mktemp("recorded") / "drive.mcap"
    env = gym.make("tral_env:TralCorridor-v0", scenario="corners", max_episode_steps=400)
    policy = load_policy("corners")
    files = files_of_policy("corners", policy)
    with DriveRecorder(path, env, seed=3, scenario="corners", policy="corners", files=files) as recorder:
        drive(env, policy, 3, on_step=recorder)
    env.close()
    return read(path)


class Hand:
    """A clock that is turned by hand."""

    s = 100.0

    def __call__(self) -> float:
        return self.s


def test_it_goes_by_the_clock(recording: Recording) -> None:
    clock = Hand()
    replay = Replay(recording, clock)
    clock.s += 1.0
    assert replay.frame.cars[0].time_s == pytest.approx(1.0, abs=0.013)
    replay.set_speed(2.0)
    clock.s += 1.0
    assert replay.frame.cars[0].time_s == pytest.approx(3.0, abs=0.013)
    replay.pause(True)
    clock.s += 1.0
    assert replay.frame.cars[0].time_s == pytest.approx(3.0, abs=0.013)
    replay.go_to(0.5)
    assert replay.frame.cars[0].time_s == pytest.approx(0.5, abs=0.013)


def test_a_frame_shows_what_was_recorded(recording: Recording) -> None:
    clock = Hand()
    replay = Replay(recording, clock)
    clock.s += 2.0
    car, k = replay.frame.cars[0], round(2.0 * 80) - 1
    truth = recording.truth[k]
    assert car.pose == (truth["x_m"], truth["y_m"], truth["yaw_rad"])
    assert car.readings["ultrasonic_left"] == recording.observation[k, 0]
    assert car.state == recording.states[k]
    assert car.estimate is not None
    assert replay.frame.plan is not None
    assert replay.frame.machine is not None


def test_at_the_end_it_stands_and_goes_on_from_the_start(recording: Recording) -> None:
    clock = Hand()
    replay = Replay(recording, clock)
    clock.s += 1000.0
    assert replay.frame.paused
    assert replay.frame.cars[0].ended
    replay.pause(False)
    assert replay.frame.cars[0].time_s == pytest.approx(0.0, abs=0.013)


def test_a_recording_without_a_tick_is_refused(recording: Recording) -> None:
    empty = Recording(path=recording.path, about=recording.about, files={}, damage="", messages={})
    with pytest.raises(BadFileError, match="no tick"):
        Replay(empty)


def test_its_page_has_a_clock_and_no_hands_on_the_car(recording: Recording) -> None:
    replay = Replay(recording)
    page = Page(replay, port=0)
    with Browser(page.url) as browser:
        browser.until(lambda: "/course/boxes" in browser.scene and "time [s]" in browser.labels)
        browser.press("Pause")
        browser.until(lambda: "Go on" in browser.labels)
        browser.set("time [s]", 2.5)
        browser.until(lambda: "2.5 s" in browser.words)
        assert not {"Take over now", "Save as machine file", "friction"} & set(browser.labels)
        assert browser.errors == []
    page.close()
