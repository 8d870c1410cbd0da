"""Measurements count honestly and come out as promised."""

import json

import pytest
from typer.testing import CliRunner, Result

from tral_env.course.geometry import build_plan
from tral_fsm.bench import speed
from tral_fsm.bench.size import DOORS, corridor
from tral_fsm.cli import app

MEASURED = {
    "contestants": [],
    "ratios": {},
    "reset_ms_per_row": 0.75,
    "reset_ms_per_row_kept": 0.25,
    "startup": {"import_s": 0.1, "make_and_reset_s": 0.5, "memory_mb_per_row": 0.4},
    "camera": None,
    "course_size": None,
}
TINY = speed.SpeedPlan(
    rows=(2,), threads=(2,), rivals=2, landmarks=(), rounds=1, seconds=0.05, camera=False, sizes=False
)


@pytest.fixture(scope="module")
def measured() -> Result:
    """A measurement by the command."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(speed, "QUICK", TINY)
        return CliRunner().invoke(app, ["bench", "speed", "--quick", "--json", "--scenario", "straight"])


def test_every_contestant_is_measured(measured: Result) -> None:
    result = json.loads(measured.stdout)
    names = [row["name"] for row in result["contestants"]]
    assert names[:4] == ["bare mj_step loop", "single env", "sync, 2 environments", "async, 2 environments"]
    assert all(row["steps_per_s"] > 0 for row in result["contestants"])
    # How large it is cannot be known from a twentieth of a second on a busy machine.
    assert result["ratios"]["single_over_bare_loop"] > 0
    assert result["reset_scenario"] == "straight"
    assert result["reset_ms_per_row"] > 0
    assert result["reset_ms_per_row_kept"] > 0
    assert result["host"]["versions"]["mujoco"]


def test_a_second_of_80_hz_is_80_steps() -> None:
    contestant = speed.Contestant(name="x", step=lambda: 1)
    contestant.wall, contestant.cpu = [80.0, 160.0, 800.0], [160.0, 160.0, 160.0]
    assert contestant.record()["sim_s_per_wall_s"] == pytest.approx(2.0)
    assert contestant.record()["sim_s_per_cpu_s"] == pytest.approx(2.0)


def test_a_ratio_is_the_median_of_its_rounds() -> None:
    one = speed.Contestant(name="single env", step=lambda: 1, wall=[1.0, 2.0, 30.0])
    other = speed.Contestant(name="bare mj_step loop", step=lambda: 1, wall=[2.0, 2.0, 3.0])
    assert speed.ratios([one, other]) == {"single_over_bare_loop": 1.0}


def test_json_is_the_only_thing_on_stdout(measured: Result) -> None:
    assert measured.exit_code == 0
    assert json.loads(measured.stdout)["plan"]["scenario"] == "straight"


def test_the_cost_of_a_reset_is_told_with_its_family(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "measure", lambda plan, on_round: MEASURED | {"reset_scenario": plan.scenario})
    result = CliRunner().invoke(app, ["bench", "speed", "--quick", "--scenario", "gates"])
    assert result.exit_code == 0
    told = " ".join(result.stdout.split())
    assert "reset of a row, family gates: 0.75 ms with a new course, 0.25 ms with one that was kept" in told


def test_larger_courses_have_more_boxes() -> None:
    sizes = [len(build_plan(corridor(doors)).box_kind) for doors in DOORS]
    assert sizes[0] == 4
    assert 30 <= sizes[1] <= 60
    assert 300 <= sizes[2] <= 500


def test_a_frame_costs_its_rendering_and_more() -> None:
    cost = speed.camera_cost(frames=3)
    assert isinstance(cost, dict)
    assert list(cost) == ["in_env_ms", "bare_render_ms", "bare_detect_ms", "bare_pose_ms"]
    assert cost["in_env_ms"] > cost["bare_detect_ms"] > 0.0
    assert cost["bare_pose_ms"] > 0.1  # two markers are in view
