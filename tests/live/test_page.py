"""The page: what browsers are sent, and what becomes of what they press. A browser is `browser.Browser`."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import Browser

from tral_fsm import load_machine
from tral_fsm.formats import read as read_machine
from tral_fsm.live.drive import LiveDrive
from tral_fsm.live.frame import Course
from tral_fsm.live.page import Page


class Shown:
    """A drive in real time with its page."""

    def __init__(self, scenario: str = "corners", seed: int = 3, drivers: tuple[str, ...] = ("corners",)) -> None:
        self.live = LiveDrive(Course(scenario=scenario, seed=seed), drivers)
        self.live.shows_camera = False
        self.page = Page(self.live, port=0, drivers=("corners", "office", "wall", "student"))
        self._thread = threading.Thread(target=self.live.run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self.live.stop()
        self._thread.join()
        self.page.close()
        self.live.close()


@pytest.fixture(scope="module")
def shown() -> Iterator[Shown]:
    shown = Shown()
    yield shown
    shown.close()


@pytest.fixture
def browser(shown: Shown) -> Iterator[Browser]:
    shown.live.order(lambda drive: drive.choose(scenario="corners", course=None, seed=3))
    shown.live.order(lambda drive: drive.drive_with(["corners"]))
    shown.live.order(lambda drive: drive.pause(False))
    done = threading.Event()
    shown.live.order(lambda drive: done.set())
    assert done.wait(60.0)
    with Browser(shown.page.url) as browser:
        yield browser
        browser.take(0.2)
        assert browser.errors == []


def test_a_drive_that_is_watched_is_bit_for_bit_the_one_that_is_not() -> None:
    alone = LiveDrive(Course(scenario="gates", seed=5), ["gate"])
    watched = LiveDrive(Course(scenario="gates", seed=5), ["gate"])
    page = Page(watched, port=0)
    for live in (alone, watched):
        live.shows_camera = False
        live.set_speed(math.inf)
    with Browser(page.url) as browser:
        browser.until(lambda: "/car_0/car" in browser.scene)
        for _ in range(480):
            alone.turn()
            watched.turn()
            browser.take(0.001)
            assert watched.lanes[0].frame().pose == alone.lanes[0].frame().pose
            assert watched.lanes[0].frame().action == alone.lanes[0].frame().action

        def tells_the_time() -> bool:
            watched.turn()  # words that were lost on their way are not sent again while nothing moves
            return any(f"{time_s / 10} s" in browser.words for time_s in range(60, 100))

        browser.until(tells_the_time)
    page.close()
    watched.close()
    alone.close()


def test_it_shows_the_course_the_car_and_the_machine(browser: Browser) -> None:
    browser.until(lambda: "/course/boxes" in browser.scene and "/car_0/car" in browser.scene)
    browser.until(lambda: 'data-state="1:follow"' in browser.words)
    browser.until(lambda: "corners, seed 3" in browser.words)
    wheels = {name for name in browser.scene if name.startswith("/car_0/wheel_")}
    assert len(wheels) == 4
    assert {f"/car_0/car/fan_{side}" for side in ("left", "front", "right")} <= browser.scene


def test_the_active_state_is_lit_with_the_values_that_were_compared(browser: Browser) -> None:
    browser.set("clock", "4 x")
    browser.until(lambda: 'rect[data-state="1:corner"]' in browser.words and 'rect[data-state="2:' in browser.words)
    browser.until(lambda: "from **" in browser.words)
    browser.set("clock", "real time")


def test_a_slider_changes_the_machine_that_drives(browser: Browser, shown: Shown) -> None:
    browser.set("speed [m/s]", 0.4)
    browser.until(lambda: "| `follow.speed` | 1.2 | 0.4 m/s |" in browser.words or "follow.speed" in browser.words)
    machine = shown.live.frame.machine
    assert machine is not None
    assert {state.id: getattr(state, "speed", None) for state in machine.states}["follow"] == 0.4
    browser.press("As the file has it")
    browser.until(lambda: shown.live.frame.machine == load_machine("corners"))
    browser.until(lambda: "Nothing is changed" in browser.words)


def test_a_value_that_is_refused_is_told_and_its_slider_goes_back(browser: Browser, shown: Shown) -> None:
    before = shown.live.frame.machine
    browser.set("speed [m/s]", -1.0)
    browser.until(lambda: "speed" in shown.live.frame.notice and browser.value("speed [m/s]") == 1.2)
    assert shown.live.frame.machine == before


def test_a_number_that_is_null_gets_a_slider_and_loses_it_again(browser: Browser, shown: Shown) -> None:
    browser.set("numbers of", "settle")
    browser.set("give unsure_speed a value", True)
    browser.until(lambda: "unsure_speed [m/s]" in browser.labels)
    browser.set("unsure_speed [m/s]", 0.4)
    browser.until(lambda: "| `settle.unsure_speed` | null | 0.4 m/s |" in browser.words)
    browser.set("give unsure_speed a value", False)
    browser.until(lambda: "unsure_speed [m/s]" not in browser.labels)
    browser.until(lambda: shown.live.frame.machine == load_machine("corners"))
    browser.set("numbers of", "follow")


def test_the_changed_machine_is_saved_as_a_file_that_drives(browser: Browser) -> None:
    browser.set("speed [m/s]", 0.5)
    browser.until(lambda: "follow.speed" in browser.words)
    browser.press("Save as machine file")
    browser.until(lambda: bool(browser.files))
    machine = read_machine(b"".join(browser.files), "machine.json", ".json")
    assert {state.id: getattr(state, "speed", None) for state in machine.states}["follow"] == 0.5
    assert Path("machine.json").exists() is False


def test_pause_and_step(browser: Browser, shown: Shown) -> None:
    browser.press("Pause")
    browser.until(lambda: "Go on" in browser.labels)
    before = shown.live.frame.cars[0].time_s
    browser.set("step", "10")
    browser.until(lambda: shown.live.frame.cars[0].time_s > before)
    browser.take(0.2)
    assert shown.live.frame.cars[0].time_s == pytest.approx(before + 10 / 80)
    browser.press("Go on")
    browser.until(lambda: shown.live.frame.cars[0].time_s > before + 0.3)


def test_the_path_of_the_drive_before_stays_until_the_course_changes(browser: Browser) -> None:
    def paths() -> set[str]:
        return {name for name in browser.scene if name.startswith("/path_0/")}

    browser.until(lambda: len(paths()) == 1)
    browser.press("Restart")
    browser.until(lambda: len(paths()) == 2)
    first = paths()
    browser.set("seed", 12)
    browser.press("Drive this course")
    browser.until(lambda: not first & paths())


def test_another_seed(browser: Browser, shown: Shown) -> None:
    browser.set("seed", 11)
    browser.press("Drive this course")
    browser.until(lambda: "seed 11" in browser.words)
    assert shown.live.course.seed == 11


def test_another_driver_in_the_middle(browser: Browser, shown: Shown) -> None:
    browser.set("driver", "wall")
    browser.press("Take over now")
    browser.until(lambda: shown.live.frame.cars[0].name == "wall")
    browser.until(lambda: "clearance [m]" in browser.labels)
    browser.set("driver", "student")
    browser.press("Take over now")
    browser.until(lambda: "it has no states" in browser.words)
    browser.until(lambda: "clearance [m]" not in browser.labels)


def test_trouble(browser: Browser, shown: Shown) -> None:
    def now(name: str) -> float:
        return shown.live.lanes[0].parameters()[name]

    browser.set("take the right ultrasonic away", True)
    browser.until(lambda: shown.live.frame.cars[0].silent == ("right",))
    browser.set("friction", 0.4)
    browser.until(lambda: now("friction") == 0.4)
    browser.set("battery [V]", 6.0)
    browser.until(lambda: now("battery_v") == 6.0)
    browser.set("push", "left")
    browser.press("Restart")
    browser.until(lambda: browser.value("take the right ultrasonic away") is False)


def test_two_cars_side_by_side(browser: Browser, shown: Shown) -> None:
    browser.set("driver", "corners")
    browser.set("beside it", "office")
    browser.press("Drive side by side")
    browser.until(lambda: "/car_1/car" in browser.scene)
    browser.until(lambda: "rgb(30, 90, 200)" in browser.words and "rgb(220, 120, 0)" in browser.words)
    assert [car.name for car in shown.live.frame.cars] == ["corners", "office"]
    browser.set("beside it", "nobody")
    browser.press("Drive side by side")
    browser.until(lambda: not any(name.startswith("/car_1") for name in browser.scene))


def test_two_browsers_see_the_same_and_one_that_goes_changes_nothing(browser: Browser, shown: Shown) -> None:
    with Browser(shown.page.url) as other:
        other.press("Pause")
        browser.until(lambda: "Go on" in browser.labels)
        other.press("Go on")
        browser.until(lambda: "Pause" in browser.labels)
        before = shown.live.frame.cars[0].time_s
    browser.until(lambda: shown.live.frame.cars[0].time_s > before + 0.2)
    assert len(shown.page.server.get_clients()) >= 1


def test_a_browser_that_comes_late_is_sent_all(browser: Browser, shown: Shown) -> None:
    browser.take(0.5)
    with Browser(shown.page.url) as late:
        late.until(lambda: "/course/boxes" in late.scene and 'data-state="1:follow"' in late.words)
        assert late.errors == []
