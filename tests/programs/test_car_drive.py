"""The drive loop with a car that fails."""

from __future__ import annotations

import gc
from typing import Any

import numpy as np
import pytest
from on_the_car import Clock, Person, Words

from tral_env.errors import HardwareError
from tral_fsm.programs.car_drive import CarDrive, Tally, status_text
from tral_fsm.programs.seat import Moment
from tral_fsm.teleop.hands import Hands
from tral_fsm.teleop.overseer import End, Overseer


class Seat:
    """A car that drives for some ticks, and then fails, also at its stop."""

    def __init__(
        self, clock: Clock, error: BaseException | None = None, readings: dict[str, float] | None = None
    ) -> None:
        self.clock, self.error, self.readings = clock, error, readings or {}
        self.stops, self.begun, self.words = 0, 0, list[tuple[str, str]]()

    def begin(self, policy: Any) -> np.ndarray:
        self.begun += 1
        return np.zeros(2, np.float32)

    def step(self, action: Any) -> Moment:
        self.clock.sleep(0.0125)
        if self.error is not None:
            raise self.error
        return Moment(np.zeros(2, np.float32), {}, 0, 0, (), "")

    def stop(self) -> None:
        self.stops += 1
        if self.error is not None:
            raise HardwareError("no answer")

    def say(self, text: str, level: str) -> None:
        self.words.append((level, text))

    def close(self) -> None:
        pass


class Still:
    def reset(self, n: int) -> None:
        pass

    def act(self, observation: Any) -> Any:
        return np.zeros(2, np.float32)


def driven(seat: Seat, then: Any = lambda now: Hands(end=now > 1.0)) -> tuple[End, CarDrive, Words]:
    words = Words()
    overseer = Overseer([Person(then)], seat.clock)
    drive = CarDrive(seat, Still(), overseer, words, seat.clock, seat.clock.sleep)
    return drive.run("arm it"), drive, words


def test_the_garbage_collector_passes_over_the_program_while_the_car_drives() -> None:
    passed_over = []

    def look(now: float) -> Hands:
        passed_over.append(gc.get_freeze_count())
        return Hands(end=now > 1.0)

    before = gc.get_freeze_count()
    driven(Seat(Clock()), look)
    assert passed_over[-1] > before + 1000
    assert gc.get_freeze_count() == 0


class Typist:
    """A device in which something waits since before anyone was asked; later its person ends the drive."""

    def __init__(self, name: str, waits: Hands) -> None:
        self.name, self._waits, self._polls = name, waits, 0

    def poll(self, now_s: float) -> Hands:
        self._polls += 1
        return self._waits if self._polls == 1 else Hands(holds=True, end=self._polls > 51)

    def close(self) -> None:
        pass


def typed_ahead(name: str, before: Hands) -> tuple[End, Seat, Words]:
    seat, words = Seat(Clock()), Words()
    overseer = Overseer([Typist(name, before)], seat.clock, must_hold=name == "gamepad")
    drive = CarDrive(seat, Still(), overseer, words, seat.clock, seat.clock.sleep)
    return drive.run("arm it"), seat, words


@pytest.mark.parametrize("name", ["keyboard", "gamepad"])
def test_a_wish_to_arm_before_the_prompt_arms_nothing(name: str) -> None:
    end, seat, words = typed_ahead(name, Hands(arm=True, holds=True))
    assert end == End(f"ended by the {name}")
    assert words.said == ["arm it"]
    assert (seat.begun, seat.clock.now) == (0, pytest.approx(101.0, abs=0.03))


@pytest.mark.parametrize(
    ("before", "why"),
    [
        (Hands(end=True), End("ended by the keyboard")),
        (Hands(stop=True, arm=True), End("emergency stop by the keyboard", failed=True)),
    ],
)
def test_a_wish_to_end_before_the_prompt_is_obeyed_at_once(before: Hands, why: End) -> None:
    end, seat, words = typed_ahead("keyboard", before)
    assert end == why
    assert (seat.begun, words.said) == (0, [])


def test_a_car_that_fails_is_stopped_and_a_stop_that_fails_is_told() -> None:
    seat = Seat(Clock(), HardwareError("the bus is dead"))
    end, _, words = driven(seat)
    assert end == End("the bus is dead", failed=True)
    assert seat.stops == 1
    assert words.said[-1] == "the stop could not be commanded: no answer"
    assert seat.words == [("error", "the drive has ended: HardwareError: the bus is dead")]


def test_a_second_ctrl_c_stops_the_car_on_its_way_out() -> None:
    seat = Seat(Clock(), KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        driven(seat)
    assert seat.stops == 1


def test_a_car_without_sensors_has_a_status_too() -> None:
    end, drive, words = driven(Seat(Clock()))
    assert end == End("ended by the keyboard")
    assert words.shown[0].split() == ["0.2", "s", "80", "Hz", "late", "0.0%"]
    assert drive.tally.figures()["distance_m"] == 0.0


def test_before_the_first_tick_there_is_no_status() -> None:
    assert status_text(Tally(), "") == ""
    assert Tally().reading("speed") is None
    assert Tally().figures()["lateness_ms"] == {"p50": 0.0, "p99": 0.0, "max": 0.0}
