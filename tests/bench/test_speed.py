"""What `tral bench speed` measures, and how it tells it."""

import json
from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from tral_env.course.geometry import build_plan
from tral_env.errors import ConfigError, RenderError
from tral_env.vector_env import TralCorridorVectorEnv
from tral_fsm.bench import plan, speed
from tral_fsm.bench.bare import bare_drive, recording
from tral_fsm.bench.commands import gentle
from tral_fsm.bench.costs import DOORS, camera_cost, corridor, size_cost
from tral_fsm.bench.shares import share_cost
from tral_fsm.bench.timing import Contestant
from tral_fsm.cli import app

MEASURED = {
    "contestants": [],
    "ratios": {},
    "reset_ms_per_row": 0.75,
    "reset_ms_per_row_kept": 0.25,
    "shares": {
        "rows": 256,
        "physics_us": 80.0,
        "serial_us": 5.0,
        "extrapolated_steps_per_s": {4: 40000.0, 16: 100000.0},
    },
    "startup": {"import_s": 0.1, "make_and_reset_s": 0.5, "memory_mb_per_row": 0.4},
    "camera": None,
    "course_size": None,
    "skipped": [{"name": "Ant-v5", "reason": "No module named 'imageio'"}],
}
TINY = plan.SpeedPlan(
    rows=(2,),
    threads=(2,),
    compared=2,
    scaling=None,
    rivals=2,
    landmarks=(),
    rounds=1,
    seconds=0.05,
    camera=False,
    sizes=False,
)


@pytest.fixture(scope="module")
def measured() -> Result:
    """A measurement by the command."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan, "QUICK", TINY)
        return CliRunner().invoke(app, ["bench", "speed", "--quick", "--json", "--scenario", "straight"])


def test_every_contestant_is_measured(measured: Result) -> None:
    result = json.loads(measured.stdout)
    names = [row["name"] for row in result["contestants"]]
    assert names[:5] == [
        "bare mj_step loop",
        "bare mj_step loop through the same drive",
        "single env",
        "sync, 2 environments",
        "async, 2 environments",
    ]
    assert all(row["steps_per_s"] > 0 for row in result["contestants"])
    # How large it is cannot be known from a twentieth of a second on a busy machine.
    assert all(ratio > 0 for ratio in result["ratios"].values())
    cpu = {row["name"]: row["sim_s_per_cpu_s"] for row in result["contestants"]}
    assert [name for name, figure in cpu.items() if figure is None] == ["async, 2 environments"] + [
        name for name in names if name.endswith("2 processes")
    ]
    assert list(result["ratios"]) == [
        "single_over_bare_loop",
        "single_over_bare_drive",
        "vector_over_bare_batch",
        "processes_over_bare_batch",
        "vector_over_sync",
        "vector_over_async",
    ]
    assert result["reset_scenario"] == "straight"
    assert result["reset_ms_per_row"] > 0
    assert result["reset_ms_per_row_kept"] > 0
    assert result["host"]["versions"]["mujoco"]


def test_a_second_of_80_hz_is_80_steps() -> None:
    contestant = Contestant(name="x", step=lambda: 1)
    contestant.wall, contestant.cpu = [80.0, 160.0, 800.0], [160.0, 160.0, 160.0]
    assert contestant.record()["sim_s_per_wall_s"] == pytest.approx(2.0)
    assert contestant.record()["sim_s_per_cpu_s"] == pytest.approx(2.0)


def test_a_ratio_is_the_median_of_its_rounds() -> None:
    walls = {
        ("bare loop", 1, 1): [2.0, 2.0, 3.0],
        ("bare drive", 1, 1): [2.0, 1.0, 3.0],
        ("single", 1, 1): [1.0, 2.0, 30.0],
        ("sync", 2, 1): [1.0] * 3,
        ("async", 2, 1): [2.0] * 3,
        ("native", 1, 1): [5.0] * 3,
        ("native", 2, 1): [1.0] * 3,
        ("native", 2, 4): [8.0] * 3,
        ("bare batch", 2, 4): [16.0] * 3,
    }
    field = [
        Contestant(name="", kind=kind, rows=rows, threads=threads, step=lambda: 1, wall=wall)
        for (kind, rows, threads), wall in walls.items()
    ]
    asked = plan.SpeedPlan(rows=(1, 2), threads=(1, 4), compared=2, scaling=(2, 1), rivals=2)
    assert speed.ratios(field, asked) == {
        "single_over_bare_loop": 1.0,
        "single_over_bare_drive": 2.0,
        "vector_over_bare_batch": 0.5,
        "vector_over_sync": 8.0,
        "vector_over_async": 4.0,
        "rows_2_over_1": 1.6,
    }


def test_a_comparison_of_rows_that_are_not_measured_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"SpeedPlan.compared: 256 rows are not among rows = \(1, 16\)"):
        plan.SpeedPlan(rows=(1, 16))


def test_a_landmark_that_lacks_a_package_is_told_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    def lacks(name: str) -> Contestant:
        raise ImportError("No module named 'imageio'")

    monkeypatch.setattr(speed, "landmark", lacks)
    monkeypatch.setattr(speed, "rival", lambda scenario, rows, mode: Contestant(name=mode, step=lambda: rows))
    field, skipped = speed.contestants(replace(TINY, landmarks=("Ant-v5",)))
    assert skipped == [{"name": "Ant-v5", "reason": "No module named 'imageio'"}]
    assert "Ant-v5" not in [contestant.name for contestant in field]
    for contestant in field:
        contestant.close()


def test_a_camera_without_opengl_is_told_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    def dark() -> dict[str, float]:
        raise RenderError("no OpenGL")

    loop = Contestant(name="", kind="", step=lambda: 1)
    monkeypatch.setattr(speed, "contestants", lambda plan: ([loop], []))
    monkeypatch.setattr(speed, "ratios", lambda field, plan: {})
    monkeypatch.setattr(speed, "reset_cost", lambda scenario: {"new": 1.0, "kept": 1.0})
    monkeypatch.setattr(speed, "startup_cost", lambda scenario: {})
    monkeypatch.setattr(speed, "share_cost", lambda scenario, rows: {})
    monkeypatch.setattr(speed, "camera_cost", dark)
    result = speed.measure(replace(TINY, camera=True))
    assert (result["camera"], result["skipped"]) == (None, [{"name": "rendered camera", "reason": "no OpenGL"}])


def test_json_is_the_only_thing_on_stdout(measured: Result) -> None:
    assert measured.exit_code == 0
    assert json.loads(measured.stdout)["plan"]["scenario"] == "straight"


def test_the_cost_of_a_reset_is_told_with_its_family(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "measure", lambda plan, on_round: MEASURED | {"reset_scenario": plan.scenario})
    result = CliRunner().invoke(app, ["bench", "speed", "--quick", "--scenario", "gates"])
    assert result.exit_code == 0
    told = " ".join(result.stdout.split())
    assert "not measured: Ant-v5: No module named 'imageio'" in told
    assert "256: 80.0 us of physics, which threads divide, and 5.0 us" in told
    assert "extrapolated, not measured: 4: 40,000, 16: 100,000" in told
    assert "reset of a row, family gates: 0.75 ms with a new course, 0.25 ms with one that was kept" in told


def test_cores_divide_the_physics_and_not_the_serial_share() -> None:
    shares = share_cost("straight", 2, ticks=3)
    physics, serial = shares["physics_us"], shares["serial_us"]
    assert min(physics, serial) > 0
    assert shares["extrapolated_steps_per_s"] == {k: pytest.approx(1e6 / (serial + physics / k)) for k in (4, 8, 16)}


def test_larger_courses_have_more_boxes() -> None:
    sizes = [len(build_plan(corridor(doors)).box_kind) for doors in DOORS]
    assert sizes[0] == 4
    assert 30 <= sizes[1] <= 60
    assert 300 <= sizes[2] <= 500


def test_the_cost_of_a_size_is_told_with_its_boxes() -> None:
    found = size_cost(rows=2, rounds=1, seconds=0.0)
    assert [row["boxes"] for row in found] == [len(build_plan(corridor(doors)).box_kind) for doors in DOORS]
    assert all(row["step_us"] > 0.0 and row["bare_us"] > 0.0 for row in found)


def test_a_frame_costs_its_rendering_and_more() -> None:
    cost = camera_cost(rounds=3, seconds=0.0)
    assert list(cost) == ["in_env_ms", "bare_render_ms", "faults_ms", "bare_detect_ms", "bare_pose_ms"]
    assert cost["in_env_ms"] > cost["bare_detect_ms"] > 0.0
    assert cost["bare_pose_ms"] > 0.1  # two markers are in view


def test_one_row_is_measured_with_the_first_number_of_threads_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    def stub(kind: str) -> Callable[..., Contestant]:
        def make(scenario: str, rows: int = 1, threads: int | str = 1) -> Contestant:
            counted = 1 if isinstance(threads, str) else threads
            return Contestant(name=kind, kind=kind, rows=rows, threads=counted, step=lambda: rows, wall=[1.0])

        return make

    for name, kind in (("native", "native"), ("bare_batch", "bare batch"), ("single", "single")):
        monkeypatch.setattr(speed, name, stub(kind))
    monkeypatch.setattr(speed, "bare_loop", stub("bare loop"))
    monkeypatch.setattr(speed, "bare_drive", stub("bare drive"))
    monkeypatch.setattr(
        speed,
        "rival",
        lambda scenario, rows, mode: Contestant(name=mode, kind=mode, rows=rows, step=lambda: rows, wall=[1.0]),
    )
    asked = replace(TINY, rows=(1,), threads=(2, 4), compared=1)
    field, _ = speed.contestants(asked)
    assert [(each.rows, each.threads) for each in field if each.kind == "native"] == [(1, 2)]
    assert speed.ratios(field, asked)["vector_over_bare_batch"] == 1.0


def test_the_bare_loop_drives_as_the_environment_does(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[mujoco.MjData] = []
    step = mujoco.mj_step

    def stepped(model: mujoco.MjModel, data: mujoco.MjData, nstep: int) -> None:
        step(model, data, nstep)
        seen[:] = [data]

    ticks = recording("straight", 1)
    env = TralCorridorVectorEnv(1, scenario="straight")
    env.reset(seed=0)
    rng, contestant = np.random.default_rng(0), bare_drive("straight")
    monkeypatch.setattr(mujoco, "mj_step", stepped)
    for _ in ticks[:40]:
        env.step(gentle(1, rng))
        contestant.step()
    assert seen[0].qpos.tobytes() == env.world.sim.physics.qpos[0].tobytes()
    env.close()
