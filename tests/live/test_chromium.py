"""The page in a real browser: a script clicks, and the drive changes. Chromium is not part of the tests' packages."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from chromium import PROGRAM, Chromium, Window, until

from tral_env.recording.read import read
from tral_fsm.live.drive import LiveDrive
from tral_fsm.live.frame import Course
from tral_fsm.live.page import Page
from tral_fsm.live.replay import Replay

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="there is no chromium on this computer")
RECORDING = Path(__file__).parents[2] / "docs" / "recordings" / "short.mcap"


@pytest.fixture(scope="module")
def chromium() -> Iterator[Chromium]:
    with Chromium(900, 600) as chromium:
        yield chromium


@pytest.fixture(scope="module")
def live() -> Iterator[LiveDrive]:
    live = LiveDrive(Course(scenario="corners", seed=3), ["corners"])
    live.shows_camera = False
    thread = threading.Thread(target=live.run, daemon=True)
    thread.start()
    yield live
    live.stop()
    thread.join()
    live.close()


@pytest.fixture(scope="module")
def page(live: LiveDrive) -> Iterator[Page]:
    page = Page(live, port=0, drivers=("corners", "wall"))
    yield page
    page.close()


@pytest.fixture(scope="module")
def window(chromium: Chromium, page: Page) -> Window:
    return chromium.window(page.url)


def press_until(window: Window, key: str, holds: Callable[[], bool]) -> None:
    """Press a key until something holds, as a person does: a page that is busy may not have the slider in focus yet."""

    def pressed() -> bool:
        window.key(key)
        end = time.monotonic() + 2.0
        while not holds() and time.monotonic() < end:
            time.sleep(0.02)
        return holds()

    until(pressed)


def test_a_recording_plays_stands_and_is_moved(chromium: Chromium) -> None:
    replay = Replay(read(RECORDING))
    replay.pause(True)
    with closing(Page(replay, port=0)) as page, closing(chromium.window(page.url)) as window:
        window.choose("clock", "0.1 x")
        until(lambda: replay.speed == 0.1)
        window.press("Go on")
        until(lambda: replay.time_s > 0.1)
        window.press("Pause")
        until(lambda: replay.paused)
        stood_s = replay.time_s
        window.click('beside("time [s]", "[role=slider]")')
        press_until(window, "End", lambda: replay.time_s == replay.duration_s > stood_s)
        press_until(window, "Home", lambda: replay.time_s == 0.0)
        window.until('document.body.innerText.includes("0.0 s")')
        assert window.errors == []


def test_a_seed_that_is_typed_is_driven(window: Window, live: LiveDrive) -> None:
    before = live.frame
    window.type("seed", "11")
    window.press("Drive this course")
    until(lambda: live.frame.title == "corners, seed 11")
    assert live.frame.plan is not before.plan
    assert live.frame.episode > before.episode
    window.until('document.body.innerText.includes("corners, seed 11")')
    assert window.errors == []


def test_a_driver_that_is_chosen_drives(window: Window, live: LiveDrive) -> None:
    window.choose("driver", "wall")
    window.press("Take over now")
    until(lambda: live.frame.cars[0].name == "wall" and live.frame.cars[0].state == "follow")
    window.until('document.body.innerText.includes("BasicFollowWall")')
    assert window.errors == []


def test_two_windows_show_one_drive_and_one_that_is_closed_changes_nothing(
    chromium: Chromium, window: Window, live: LiveDrive, page: Page
) -> None:
    other = chromium.window(page.url)
    other.press("Pause")
    window.until('!!by("Go on", "button")')
    assert live.frame.paused
    window.press("Go on")
    other.until('!!by("Pause", "button")')
    until(lambda: not live.frame.paused)
    other.close()
    until(lambda: len(page.server.get_clients()) == 1)
    before = live.frame.episode
    window.press("Restart")
    until(lambda: live.frame.episode > before)
    assert window.errors == []
