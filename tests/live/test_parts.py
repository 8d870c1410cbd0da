"""What the parts of the page say and draw, without a page."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.course.generate import generate_plan
from tral_env.interface import NO_ECHO_M
from tral_fsm import CarEstimate, load_machine, machine_names
from tral_fsm.draw.panels import marks_of_states, marks_of_transitions, state_tones
from tral_fsm.draw.picture import picture
from tral_fsm.draw.svg import lit, svg
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.wall_filter import WallEstimate
from tral_fsm.live import meshes
from tral_fsm.live.charts import History, values
from tral_fsm.live.frame import CarFrame, Frame
from tral_fsm.live.numbers import (
    can_give,
    first_value,
    hint_of,
    label_of,
    limits_of,
    nulls,
    parts,
    round_step,
    span_of_slider,
)
from tral_fsm.live.overlays import believed, echo
from tral_fsm.live.page import status
from tral_fsm.tuning.listing import listing
from tral_fsm.tuning.parameters import sites, with_value
from tral_fsm.tuning.ranges import limits


def frame(time_s: float = 0.0, **more: object) -> CarFrame:
    return CarFrame(name="car", time_s=time_s, readings={}, action=(0.0, 0.0), **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", machine_names())
def test_every_number_of_every_machine_has_a_slider_that_holds_it(name: str) -> None:
    for number in listing(load_machine(name)):
        if isinstance(number.value, bool | str):
            continue
        low, high, step = span_of_slider(number)
        lowest, highest = limits_of(number)
        assert lowest <= low <= number.value <= high <= highest
        assert 0.0 < step <= high - low
        assert label_of(number).endswith(f"[{number.unit}]") or not number.unit
        assert "allowed" in hint_of(number, number.value)


@pytest.mark.parametrize("name", machine_names())
def test_every_number_belongs_to_a_state(name: str) -> None:
    machine = load_machine(name)
    shown = {path for state in machine.states for _, of in parts(machine, state.label or str(state.id)) for path in of}
    assert shown == {one.path for one in listing(machine)} | set(nulls(machine))


@pytest.mark.parametrize("name", machine_names())
def test_every_number_that_is_null_can_be_given_a_value_and_be_null_again(name: str) -> None:
    machine = load_machine(name)
    known = {site.path: site for site in sites(machine)}
    for path in nulls(machine):
        if not can_give(machine, known[path]):
            continue
        value = first_value(known[path])
        low, high = limits(known[path].spec, path.rpartition(".")[2])
        assert low <= value <= high
        given = with_value(machine, path, value)
        assert path not in nulls(given)
        assert with_value(given, path, None) == machine


@given(st.floats(1e-6, 1e6))
def test_a_step_is_round_and_no_larger(step: float) -> None:
    found = round_step(step)
    assert found <= step * 1.001
    assert found > step / 2.6
    assert f"{found:.0e}"[0] in "125"


@pytest.mark.parametrize("name", machine_names())
def test_every_state_and_transition_can_be_lit(name: str) -> None:
    machine = load_machine(name)
    drawn = svg(picture(machine, load_machine))
    states, transitions = marks_of_states(machine, load_machine), marks_of_transitions(machine, load_machine)
    assert states.keys() == state_tones(machine, load_machine).keys()
    for marks in states.values():
        for rule in lit(marks).splitlines():
            assert rule[rule.index("[") + 1 : rule.index("]")] in drawn
    for mark in transitions.values():
        word = lit((), [mark]).split('"')[1]
        assert f'data-transitions="{word}"' in drawn or f"{word} " in drawn or f' {word}"' in drawn


def test_a_fan_is_red_near_green_far_and_grey_without_an_echo() -> None:
    (near, red), (far, green) = echo(0.1, 0.0), echo(4.0, 0.0)
    assert (near, far) == (0.1, 4.0)
    assert red[0] > red[1]
    assert green[1] > green[0]
    assert len(set(echo(NO_ECHO_M, 0.0)[1])) == 1
    assert len(set(echo(1.0, 0.5)[1])) == 1


def test_a_belief_is_drawn_where_dead_reckoning_began() -> None:
    wall = WallEstimate(1.0, 0.8, 0.129, 0.0)
    estimate = CarEstimate(tick=1, left_wall=wall, gate=Detection(3, 2.0, 0.0, 0.0, 0.0, True, 0.8, 3))
    at_origin = np.array([points for points, _ in believed(estimate, (0.0, 0.0, 0.0))])
    turned = np.array([points for points, _ in believed(estimate, (1.0, 2.0, math.pi / 2))])
    assert np.allclose(turned[..., 0], 1.0 - at_origin[..., 1])
    assert np.allclose(turned[..., 1], 2.0 + at_origin[..., 0])
    outline, walls, gate = at_origin[:4], at_origin[4:7], at_origin[7:]
    assert outline[..., 0].min() == pytest.approx(-0.071)
    assert np.allclose(walls[..., 1], 0.9)
    assert np.allclose(gate[:2, 0, 0], 2.0)
    assert gate[0, 0, 1] == pytest.approx(0.52)


def test_charts_show_the_last_twenty_seconds_and_begin_anew() -> None:
    history = History()
    for k in range(1, 3001):
        history.add(frame(k * 0.0125, speed_mps=1.0))
    columns = history.columns()
    assert columns.shape == (1 + len(values(frame())), 200)
    assert columns[0, -1] - columns[0, 0] == pytest.approx(20.0, abs=0.3)
    history.add(frame(0.1))
    assert history.columns().shape[1] == 1


def test_the_course_is_drawn_where_it_is() -> None:
    _, plan = generate_plan("gates", np.random.default_rng(3), hard=False)
    low, high = meshes.course_mesh(plan).bounds
    reach = np.linalg.norm(plan.box_size[:, :2], axis=1)[:, None]
    assert (low[:2] >= (plan.box_position[:, :2] - reach).min(axis=0) - 1e-6).all()
    assert (high[:2] <= (plan.box_position[:, :2] + reach).max(axis=0) + 1e-6).all()
    assert low[2] == pytest.approx(0.0, abs=1e-6)
    floor = meshes.floor_mesh(plan).bounds
    assert (floor[0, :2] < low[:2]).all()
    assert (floor[1, :2] > high[:2]).all()


def test_the_car_is_as_large_as_it_is() -> None:
    car = meshes.body_meshes(meshes.car_model())
    assert set(car) == {
        "car/car",
        *(f"car/wheel_{end}_{side}" for end in ("front", "rear") for side in ("left", "right")),
    }
    length, width, _ = car["car/car"].extents
    assert length == pytest.approx(0.4, abs=0.05)
    assert width == pytest.approx(0.2, abs=0.03)
    assert car["car/wheel_rear_left"].extents[0] == pytest.approx(0.064, abs=0.002)


def test_names_in_the_status_are_shown_as_they_are() -> None:
    car = CarFrame(name="my_*car*|.json", time_s=1.0, readings={}, action=(0.0, 0.0), state="turn_<b>")
    frame = Frame(episode=0, title="_a_, seed 3", plan=None, cars=(car,))
    assert status(frame).split("\n\n") == [r"**\_a\_, seed 3**", r"my\_\*car\*\|\.json: 1.0 s, turn\_&lt;b&gt;"]
