"""The stepper: time, the start of a course, what a car that stands and one that drives feel."""

import numpy as np
import pytest
from one_car import GATE_AHEAD, ROW, drive, one_car

from tral_env.course.geometry import build_plan
from tral_env.errors import SimulationError
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.options import CorridorConfig
from tral_env.world import World


def test_a_car_begins_at_the_start_of_its_plan_at_time_0() -> None:
    sim = one_car()
    assert sim.pose[0] == pytest.approx(sim.plan(0).start, abs=1e-9)
    assert sim.time_s[0] == 0.0


def test_a_step_takes_a_control_period() -> None:
    sim = one_car()
    drive(sim, 0.0, 0.0, 3)
    assert sim.time_s[0] == 3 * CONTROL_PERIOD_S
    assert sim.physics.substeps * sim.physics.model.opt.timestep == pytest.approx(CONTROL_PERIOD_S)


def test_rows_that_do_not_move_keep_state_and_time() -> None:
    sim = one_car()
    drive(sim, 0.0, 0.5, 40)
    before, time_s = sim.physics.qpos.copy(), sim.time_s.copy()
    sim.step(np.array([[0.0, 0.5]]), np.zeros(0, np.int64))
    assert np.array_equal(sim.physics.qpos, before)
    assert np.array_equal(sim.time_s, time_s)


def test_a_car_that_stands_feels_its_weight_alone() -> None:
    sim = one_car()
    drive(sim, 0.0, 0.0, 40)
    assert sim.physics.motion()[0] == pytest.approx([0, 0, 0, 0, 0, 9.81], abs=0.05)
    assert sim.physics.motion_at_rest()[0].tolist() == [0, 0, 0, 0, 0, pytest.approx(9.81)]


def test_a_car_that_turns_left_feels_a_positive_yaw_rate() -> None:
    sim = one_car()
    drive(sim, 0.5, 0.3, 80)
    assert sim.physics.motion()[0, 2] == pytest.approx(
        float(sim.physics.qvel[0, sim.physics.handles.root_dof + 5]), abs=0.05
    )
    assert sim.physics.motion()[0, 2] > 0.2


def test_the_boxes_of_a_course_stand_around_the_car() -> None:
    sim = one_car(GATE_AHEAD)
    placed = sim.physics.geom["geom_pos"][0]
    for box in build_plan(GATE_AHEAD).box_position:
        assert np.abs(placed - box).max(axis=1).min() < 1e-9


def test_a_state_that_is_not_finite_is_an_error_with_the_row() -> None:
    sim = one_car()
    sim.physics.qpos[0, 0] = np.inf
    with pytest.raises(SimulationError, match=r"rows \[0\]"):
        sim.step(np.zeros((1, 2)), ROW)


@pytest.mark.parametrize("nthread", [1, 2])
def test_a_row_that_rests_or_begins_anew_beside_others_reads_what_it_reads_alone(nthread: int) -> None:
    config, draw = CorridorConfig(scenario="doors", groups=("line", "imu", "battery")), np.random.default_rng(nthread)
    among, alone = World(3, config, nthread=nthread), [World(1, config) for _ in range(3)]
    rngs, own_rngs = ([np.random.default_rng(seed) for seed in range(3)] for _ in range(2))
    begin = np.arange(3)
    for _ in range(60):
        among.reset(among.request(begin), rngs)
        for row in begin:
            alone[row].reset(alone[row].request(ROW), [own_rngs[row]])
        moving, commands = np.flatnonzero(draw.random(3) < 0.7), draw.uniform((-1.0, -0.3), 1.0, (3, 2))
        among.step(commands, moving)
        for row, world in enumerate(alone):
            world.step(commands[[row]], None if row in moving else ROW[:0])
        read = [world.observation()[0].tobytes() for world in alone]
        assert [row.tobytes() for row in among.observation()] == read
        begin = np.flatnonzero(draw.random(3) < 0.1)


def test_a_row_keeps_its_own_sensors_also_those_that_are_not_due() -> None:
    config, commands = CorridorConfig(scenario="corners"), ((0.1, 0.5), (-0.2, 0.3), (0.3, -0.2))
    among = World(3, config)
    among.reset(among.request(np.arange(3)), [np.random.default_rng(seed) for seed in range(3)])
    rays: list[list[bytes]] = []
    for row, command in enumerate(commands):
        alone = World(1, config)
        alone.reset(alone.request(ROW), [np.random.default_rng(row)])
        history = []
        for _ in range(40):
            alone.step(np.array([command]))
            history.append(alone.sim.physics.sensordata[0].tobytes())
        rays.append(history)
    for tick in range(40):
        among.step(np.array(commands))
        told = [among.sim.physics.sensordata[row].tobytes() for row in range(3)]
        assert told == [history[tick] for history in rays]
