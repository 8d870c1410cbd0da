"""The page of a real car: it is sent moments, it can ask for the stop, and its loss changes nothing."""

from __future__ import annotations

import os
import pickle
import signal
import socket
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from browser import Browser
from websockets.exceptions import ConnectionClosed

from tral_env.interface import CORE_LAYOUT
from tral_fsm import load_policy
from tral_fsm.live.car import CarPage, CarView
from tral_fsm.teleop.hands import Hands
from tral_fsm.teleop.overseer import Overseer

READINGS = {"ultrasonic_left": 0.9, "ultrasonic_front": 3.0, "ultrasonic_right": 0.5, "speed": 0.4}


def free_port() -> int:
    with socket.socket() as door:
        door.bind(("127.0.0.1", 0))
        port: int = door.getsockname()[1]
        return port


class Car:
    """A page beside a machine that drives."""

    def __init__(self) -> None:
        self.port, self.policy = free_port(), load_policy("wall")
        self.page = CarPage(self.policy, "wall", "127.0.0.1", self.port)

    def tick(self) -> None:
        row = CORE_LAYOUT.pack({name: np.array([value]) for name, value in READINGS.items()}, 1)[0]
        steering, throttle = self.policy.act(row).tolist()
        self.page.show(READINGS, (steering, throttle))

    def browser(self) -> Browser:
        end = time.monotonic() + 30.0
        while True:
            try:
                browser = Browser(f"http://127.0.0.1:{self.port}")
                browser.until_open()
                return browser
            except (OSError, ConnectionClosed):
                assert time.monotonic() < end, "the page never came"
                time.sleep(0.1)


@pytest.fixture
def car() -> Iterator[Car]:
    car = Car()
    yield car
    car.page.close()


def test_the_page_shows_what_the_car_does_and_can_stop_it(car: Car) -> None:
    assert car.page.poll(0.0) == Hands()
    with car.browser() as browser:
        browser.until(lambda: "not armed" in browser.words)

        def told() -> bool:
            car.tick()
            return "wall: " in browser.words and 'data-state="1:0"' in browser.words

        browser.until(told)
        assert not {"Pause", "Take over now", "Save as machine file", "friction"} & set(browser.labels)
        overseer, end = Overseer([car.page], time.monotonic), []
        browser.press("STOP THE CAR")
        browser.until(lambda: bool(end.append(overseer.look()) or end[-1]))
        assert end[-1] is not None
        assert end[-1].why == "emergency stop by the page in the browser"
        browser.until(lambda: "The stop was asked for" in browser.words)
        assert browser.errors == []


def test_a_page_that_dies_stops_nobody_and_is_waited_for_by_nobody(car: Car) -> None:
    process: Any = car.page._process
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    for _ in range(200):
        car.tick()
        assert car.page.poll(0.0) == Hands()


def test_a_page_that_hangs_is_waited_for_by_nobody(car: Car) -> None:
    process: Any = car.page._process
    os.kill(process.pid, signal.SIGSTOP)
    for _ in range(2000):  # one that waited would wait for ever
        car.tick()
        assert car.page.poll(0.0) == Hands()
    os.kill(process.pid, signal.SIGCONT)


def test_what_cannot_be_sent_is_no_matter_of_the_drive(car: Car) -> None:
    unsendable: Any = {"speed": lambda: 0.0}
    for _ in range(8):
        car.page.show(unsendable, (0.0, 0.0))
    assert car.page.poll(0.0) == Hands()


def test_a_stop_that_nobody_takes_is_not_told_as_asked_for() -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.send(pickle.dumps(None))
    with theirs:
        view = CarView(theirs)
        ours.close()
        view.emergency_stop()
    assert view.frame.notice == ""
