"""The real car behind the node: what becomes of it when the process of its actuator is gone."""

from __future__ import annotations

import os
import signal
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tral_env.errors import ActuatorLostError, HardwareError
from tral_env.hardware.actuator.client import ActuatorProcess
from tral_env.hardware.env import TralCarEnv
from tral_env.interface import CORE_LAYOUT
from tral_env.ros.car_body import CarBody

LOST = "the actuator's process is gone; its keeper ends the pulses. Open the car anew"
CAR = """
version = 1
name = "bench"
sensors = "none"

[board]
driver = "log"
bus = "{}"

[pulses]
file = "tt01"
"""


class Env:
    """Stands in for `TralCar-v0`."""

    sensors = None

    def __init__(self) -> None:
        self.readings: dict[str, float] = {}
        self.is_lost = self.keeper_tries = False
        self.did: list[str] = []

    def _do(self, what: str) -> Any:
        self.did.append(what)
        if self.is_lost:
            raise ActuatorLostError(LOST)
        return np.zeros(len(CORE_LAYOUT.names), np.float32)

    def reset(self) -> Any:
        return self._do("reset"), {}

    def step(self, action: Any) -> Any:
        return self._do("step"), 0.0, False, False, {}

    def stop(self) -> None:
        self._do("stop")

    def close(self) -> None:
        self.did.append("close")
        if self.keeper_tries:
            raise HardwareError("the actuator's process could not end the pulses yet")


class Garage:
    """Opens cars, unless something is wrong."""

    def __init__(self) -> None:
        self.opened: list[Env] = []
        self.refuses = ""

    def __call__(self) -> Any:
        if self.refuses:
            raise HardwareError(self.refuses)
        self.opened.append(Env())
        return self.opened[-1]


@pytest.fixture
def garage() -> Garage:
    return Garage()


@pytest.fixture
def body(garage: Garage) -> CarBody:
    found = CarBody(garage, "bench", sees=False, sleep=lambda seconds: None)
    found.arm()
    return found


def test_a_lost_actuator_stops_the_car_and_the_error_says_what_to_do(body: CarBody, garage: Garage) -> None:
    garage.opened[0].is_lost = True
    with pytest.raises(HardwareError, match="Open the car anew: true on the topic arm does that"):
        body.step(0.0, 0.2)
    body.stop()
    assert len(garage.opened) == 1


def test_only_arming_opens_the_car_anew(body: CarBody, garage: Garage) -> None:
    garage.opened[0].is_lost = True
    for _ in range(3):
        body.rest()
    assert len(garage.opened) == 1
    body.arm()
    assert [each.did[-1] for each in garage.opened] == ["close", "reset"]
    assert body.step(0.0, 0.2).over == ""


def test_a_board_that_an_old_process_still_holds_is_not_driven_and_each_arming_tries_again(
    body: CarBody, garage: Garage
) -> None:
    garage.opened[0].is_lost = garage.opened[0].keeper_tries = True
    garage.refuses = "another process drives the board"
    for _ in range(2):
        with pytest.raises(HardwareError, match="another process drives the board"):
            body.arm()
        assert body.rest().readings == {"steering": 0.0, "throttle": 0.0}
    with pytest.raises(HardwareError, match="not open"):
        body.step(0.0, 0.2)
    garage.refuses = ""
    body.arm()
    assert garage.opened[1].did == ["reset"]
    body.close()


def test_another_fault_opens_nothing(body: CarBody, garage: Garage, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails() -> Any:
        raise HardwareError("an ultrasonic does not answer")

    monkeypatch.setattr(garage.opened[0], "reset", fails)
    with pytest.raises(HardwareError, match="an ultrasonic"):
        body.arm()
    assert len(garage.opened) == 1


def test_a_car_whose_worker_was_killed_drives_again_when_it_is_armed_again(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text(CAR.format(tmp_path / "pulses.log"))
    body = CarBody(partial(TralCarEnv, config=path, max_duration_s=1e9), "bench", sees=False)
    try:
        body.arm()
        body.step(0.0, 0.0)
        os.kill(hello(body)["worker"], signal.SIGKILL)
        with pytest.raises(HardwareError, match="the worker died"):
            until_it_fails(body)
        with suppress(HardwareError):
            body.stop()
        before = hello(body)["keeper"]
        body.arm()
        body.step(0.0, 0.0)
        assert hello(body)["keeper"] != before
    finally:
        body.close()


def hello(body: CarBody) -> Any:
    assert body.env is not None
    assert isinstance(body.env.output, ActuatorProcess)
    return body.env.output.hello


def until_it_fails(body: CarBody) -> None:
    end_s = time.monotonic() + 30.0
    while time.monotonic() < end_s:
        body.step(0.0, 0.0)


class Sensors:
    """Sensors that do not answer at first."""

    def __init__(self) -> None:
        self.starts = 0

    def start(self) -> None:
        self.starts += 1
        if self.starts < 3:
            raise OSError(121, "Remote I/O error")

    def read(self, now_s: float) -> dict[str, float]:
        return {"distance": 1.0}


def test_sensors_that_did_not_start_are_started_again_and_the_reason_is_told(body: CarBody, garage: Garage) -> None:
    garage.opened[0].sensors = Sensors()  # type: ignore[assignment]
    body._started = False
    ticks = [body.rest() for _ in range(4)]
    assert [each.trouble for each in ticks] == ["[Errno 121] Remote I/O error"] * 2 + [""] * 2
    assert ticks[-1].readings["distance"] == 1.0
    assert garage.opened[0].sensors.starts == 3  # type: ignore[attr-defined]
