"""Markers that are not there: one image alone moves nothing, and no gate is guessed behind a wall."""

from functools import cache

import pytest
import toy
from hypothesis import given, settings
from hypothesis import strategies as st
from readings import one_state

from tral_fsm import load_machine
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.formats.tral_json import loads
from tral_fsm.runtime.driver import Driver

FOLLOW = '{"root": 0, "states": [{"id": 0, "type": "FollowCorridor", "speed": 0.6, "final": true}]}'
SIGHTINGS = {"post of gate 8": (17, 1.5, 0.6), "sign for left": (40, 1.5, 0.3), "post of gate 18": (37, 1.0, -0.4)}


def estimates(machine: str, arrivals: tuple[int, ...], marker: int, x: float, y: float) -> list[CarEstimate]:
    """What a machine is told in each tick of 4 s in a plain corridor, where images show a marker."""
    world, told = toy.straight(2.0, y=0.1), []
    driver = Driver(load_machine(machine))

    def act(observation):
        action = toy.one_car(driver)(observation)
        told.append(driver.estimate)
        return action

    world.drive(toy.showing(world, act, arrivals, marker, x, y), 4.0)
    return told


@cache
def undisturbed(machine: str) -> str:
    return repr(estimates(machine, (), 0, 0.0, 0.0))


@pytest.mark.parametrize("machine", ["gate", "gate_scurve", "office", "crossing"])
@pytest.mark.parametrize("sighting", SIGHTINGS)
def test_one_false_image_moves_nothing(machine: str, sighting: str) -> None:
    assert repr(estimates(machine, (160,), *SIGHTINGS[sighting])) == undisturbed(machine)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 319), st.integers(0, 42), st.floats(0.3, 6.0), st.floats(-3.0, 3.0))
def test_one_false_image_moves_nothing_whatever_it_shows(tick: int, marker: int, x: float, y: float) -> None:
    assert repr(estimates("office", (tick,), marker, x, y)) == undisturbed("office")


def test_two_false_images_at_different_places_move_nothing() -> None:
    bench = one_state(type="Motor", throttle=0.1)
    for y in (0.6, -0.6, 0.6):
        bench.tick(marker_id=17.0, marker_x=1.5, marker_y=y, marker_heading=0.0, marker_age=0.03)
        assert (bench.estimate.marker.id, bench.estimate.guessed_gate.id) == (-1, -1)


def test_two_images_that_agree_are_believed() -> None:
    told = estimates("office", (160, 165), *SIGHTINGS["post of gate 8"])
    assert [told[tick].marker.id for tick in (164, 165)] == [-1, 17]


class TestBehindAWall:
    """A wall that the car hears beside it has no gate behind it."""

    @staticmethod
    def guess(marker: int, x: float, y: float, width: float = 2.0) -> int:
        """Gate that is guessed from a marker at x, y, after 3 s along the middle of a corridor; -1: none."""
        world, driver = toy.straight(width), Driver(loads(FOLLOW))
        world.drive(toy.showing(world, toy.one_car(driver), (240, 245), marker, x, y), 3.1)
        assert driver.estimator.walls.direction_known
        assert driver.estimate.marker.id == marker
        return driver.estimate.guessed_gate.id

    @pytest.mark.parametrize(
        ("marker", "y"), [(17, 0.75), (16, -0.75)], ids=["right post at the left wall", "left post at the right wall"]
    )
    def test_a_gate_whose_middle_lies_there_is_not_guessed(self, marker: int, y: float) -> None:
        assert self.guess(marker, 1.5, y) == -1

    @pytest.mark.parametrize(("marker", "y"), [(16, 0.75), (17, -0.75), (17, 0.5)])
    def test_one_between_the_walls_is(self, marker: int, y: float) -> None:
        assert self.guess(marker, 1.5, y) == 8

    def test_a_wider_corridor_has_room_for_it(self) -> None:
        assert self.guess(17, 1.5, 0.75, width=2.6) == 8

    def test_walls_tell_nothing_of_what_is_far_ahead(self) -> None:
        assert self.guess(17, 3.0, 0.75) == 8

    def test_a_car_that_hears_no_walls_guesses_it(self) -> None:
        bench = one_state(type="Motor", throttle=0.1)
        bench.see(marker_id=17.0, marker_x=1.5, marker_y=0.75, marker_heading=0.0, marker_age=0.03)
        assert bench.estimate.guessed_gate.id == 8
