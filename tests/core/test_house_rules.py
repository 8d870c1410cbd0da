"""Who may import whom: the rules hold, and each rule finds what breaks it."""

import subprocess
import sys
from functools import cache
from pathlib import Path

import house_rules as rules
import pytest
from house_rules import Imports, Rule

ROOT = Path(__file__).parents[2]

BROKEN: dict[Rule, Imports] = {
    rules.the_waist_needs_numpy_and_spaces_alone: {"tral_env.se2": {"math", "numpy", "scipy.spatial"}},
    rules.laws_need_the_waist_config_and_course: {"tral_env.sensors.hall": {"tral_env.simulation.sim"}},
    rules.laws_reach_no_physics: {
        "tral_env.task": {"tral_env.course.plan"},
        "tral_env.course.plan": {"tral_env.course.scene"},
        "tral_env.course.scene": {"mujoco"},
    },
    rules.calibration_needs_the_waist_config_and_perception: {
        "tral_env.calibration.views": {"tral_env.simulation.board_scene"}
    },
    rules.calibration_reaches_no_physics: {
        "tral_env.calibration.views": {"tral_env.perception.camera"},
        "tral_env.perception.camera": {"mujoco"},
    },
    rules.options_know_what_they_set_and_nothing_that_steps: {"tral_env.options": {"tral_env.world"}},
    rules.one_module_of_course_and_one_of_perception_meet_physics: {
        "tral_env.course.scene": {"mujoco"},
        "tral_env.course.markers": {"mujoco.batch"},
    },
    rules.course_needs_the_waist_and_config: {"tral_env.course.route": {"tral_env.actuation"}},
    rules.recordings_need_the_waist_and_atomic: {"tral_env.recording.read": {"tral_env.hardware"}},
    rules.the_car_needs_little: {"tral_env.hardware.env": {"tral_env.world"}},
    rules.the_car_reaches_nothing_heavy: {
        "tral_env.hardware.camera": {"tral_env.perception.gate"},
        "tral_env.perception.gate": {"torch.nn"},
    },
    rules.randomization_needs_the_waist_and_config: {"tral_env.randomization": {"tral_env.calibration.camera_info"}},
    rules.the_world_knows_the_simulation_and_no_shell: {"tral_env.world": {"tral_env.env"}},
    rules.the_actuator_reaches_the_standard_library_and_the_buses_alone: {
        "tral_env.hardware.actuator.worker": {"select", "smbus2", "tral_env.hardware.i2c"},
        "tral_env.hardware.i2c": {"numpy.linalg"},
    },
    rules.simulation_knows_no_world: {"tral_env.simulation.sim": {"tral_env.task"}},
    rules.the_twin_knows_the_world_and_the_car: {"tral_env.twin.car": {"tral_env.vector_env"}},
    rules.shells_know_the_world_and_not_the_simulation: {"tral_env.env": {"tral_env.simulation.sim"}},
    rules.the_two_environments_do_not_know_each_other: {"tral_env.vector_env": {"tral_env.env"}},
    rules.the_environment_knows_no_state_machine: {"tral_env.course.plan": {"tral_fsm.control.laws"}},
    rules.policies_know_the_waist_alone: {"tral_fsm.states.wall": {"tral_env.config"}},
    rules.policies_are_built_floor_by_floor: {"tral_fsm.runtime.driver": {"tral_fsm.formats.library"}},
    rules.a_person_at_the_wheel_knows_the_waist_alone: {"tral_fsm.teleop.pilot": {"tral_env.hardware.env"}},
    rules.pictures_of_machines_know_the_definition_alone: {"tral_fsm.draw.picture": {"tral_fsm.runtime.machine"}},
    rules.nobody_imports_what_comes_last: {
        "tral_fsm.programs.tune": {"tral_fsm.report.tuning.page"},
        "tral_fsm.cli.tune": {"tral_fsm.programs.tune", "tral_fsm.report.tuning.page"},
        "benchmarks.gates": {"tral_fsm.cli.terminal"},
    },
    rules.report_drives_nothing: {"tral_fsm.report.drive.video": {"tral_fsm.runtime.policy"}},
    rules.report_reaches_no_physics: {
        "tral_fsm.report.tuning.page": {"tral_fsm.tuning.tables"},
        "tral_fsm.tuning": {"tral_fsm.tuning.evaluator"},
        "tral_fsm.tuning.evaluator": {"mujoco.batch"},
    },
    rules.no_circle_of_rooms: {
        "tral_fsm.tuning.holdout": {"tral_fsm.learning.export"},
        "tral_fsm.learning.export": {"tral_fsm.control.laws"},
        "tral_fsm.learning.teacher": {"tral_fsm.tuning.study"},
    },
    rules.no_circle_of_modules: {
        "tral_env.course.plan": {"tral_env.course.route"},
        "tral_env.course.route": {"tral_env.course.plan"},
    },
}
"""The smallest imports that break each rule."""


@cache
def imports(types: bool = True) -> Imports:
    return rules.imports_of(ROOT, types=types)


def name(rule: Rule) -> str:
    return rule.__name__


@pytest.mark.parametrize("rule", rules.RULES, ids=name)
def test_the_house_keeps(rule: Rule) -> None:
    assert rule(imports(types=rule not in rules.LOADING)) == []


@pytest.mark.parametrize("rule", rules.RULES, ids=name)
def test_a_house_that_breaks_it_is_found_out_by(rule: Rule) -> None:
    assert len(rule(BROKEN[rule])) == 1


@pytest.mark.parametrize(
    ("room", "above"),
    [("control", "formats"), ("runtime", "formats"), ("estimation", "control"), ("states", "conditions")],
)
def test_a_floor_knows_none_above_it(room: str, above: str) -> None:
    lower, upper = f"tral_fsm.{room}.here", f"tral_fsm.{above}.there"
    assert rules.policies_are_built_floor_by_floor({lower: {upper}}) == [f"{lower} imports {upper}"]
    assert rules.policies_are_built_floor_by_floor({upper: {lower}}) == []


def test_a_circle_is_told_by_its_rooms() -> None:
    assert rules.no_circle_of_rooms(BROKEN[rules.no_circle_of_rooms]) == ["tral_fsm.learning <-> tral_fsm.tuning"]


def test_imports_within_functions_count(tmp_path: Path) -> None:
    room = tmp_path / "tral_env" / "course"
    room.mkdir(parents=True)
    (room / "__init__.py").write_text("")
    (room / "plan.py").write_text("from tral_env.course import route\n")
    (room / "route.py").write_text("def lay():\n    from tral_env.course.plan import Plan\n    import mujoco.batch\n")
    assert rules.imports_of(tmp_path) == {
        "tral_env.course": set(),
        "tral_env.course.plan": {"tral_env.course.route"},
        "tral_env.course.route": {"tral_env.course.plan", "mujoco.batch"},
    }


def test_relative_imports_count_by_their_full_names(tmp_path: Path) -> None:
    room = tmp_path / "tral_env" / "course"
    room.mkdir(parents=True)
    (tmp_path / "tral_env" / "world.py").write_text("")
    (room / "__init__.py").write_text("from .plan import Plan\n")
    (room / "plan.py").write_text("from . import route\nfrom ..world import World\nfrom .. import world\n")
    (room / "route.py").write_text("")
    assert rules.imports_of(tmp_path) == {
        "tral_env.world": set(),
        "tral_env.course": {"tral_env.course.plan"},
        "tral_env.course.plan": {"tral_env.course.route", "tral_env.world"},
        "tral_env.course.route": set(),
    }


def test_imports_of_benchmarks_count(tmp_path: Path) -> None:
    (tmp_path / "benchmarks").mkdir()
    (tmp_path / "benchmarks" / "gates.py").write_text("from run_settings import RunSettings\nimport tral_fsm.cli\n")
    (tmp_path / "tral_fsm" / "cli").mkdir(parents=True)
    (tmp_path / "tral_fsm" / "cli" / "__init__.py").write_text("")
    found = rules.imports_of(tmp_path)
    assert rules.nobody_imports_what_comes_last(found) == ["benchmarks.gates imports tral_fsm.cli"]


def test_imports_for_types_do_not_load_anything(tmp_path: Path) -> None:
    (tmp_path / "tral_env").mkdir()
    text = "if TYPE_CHECKING:\n    import mujoco\nelse:\n    import numpy\n"
    (tmp_path / "tral_env" / "task.py").write_text(text)
    assert rules.imports_of(tmp_path, types=False) == {"tral_env.task": {"numpy"}}
    assert rules.imports_of(tmp_path) == {"tral_env.task": {"mujoco", "numpy"}}


def test_models_are_compiled_in_one_module_of_course() -> None:
    users = [path for path in (ROOT / "tral_env").rglob("*.py") if ".compile()" in path.read_text("utf-8")]
    assert [path.parent.name for path in users] == ["course"]


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = "import sys, tral_env; print([m for m in ('mujoco', 'cv2', 'torch', 'matplotlib') if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_what_holds_arrays_is_not_compared_by_its_values() -> None:
    assert rules.array_dataclasses_that_compare(ROOT) == []


@pytest.mark.parametrize(
    ("made", "field", "found"),
    [
        ("@dataclass", "route: Array", ["tral_env/plan.py: Plan"]),
        ("@dataclass(frozen=True)", "route: NDArray[Any] | None = None", ["tral_env/plan.py: Plan"]),
        ("@dataclass(eq=False)", "route: Array", []),
        ("@dataclass", "route: Array = field(compare=False)", []),
        ("@dataclass", "laps: int", []),
    ],
)
def test_a_dataclass_that_holds_arrays_is_found(tmp_path: Path, made: str, field: str, found: list[str]) -> None:
    (tmp_path / "tral_env").mkdir()
    (tmp_path / "tral_env" / "plan.py").write_text(f"{made}\nclass Plan:\n    {field}\n")
    assert rules.array_dataclasses_that_compare(tmp_path) == found


def test_functions_are_short() -> None:
    assert rules.long_functions(ROOT) == []


@pytest.mark.parametrize(("statements", "found"), [(40, []), (41, ["tests/long.py: talk has 41 lines"])])
def test_a_docstring_does_not_make_a_function_long(tmp_path: Path, statements: int, found: list[str]) -> None:
    (tmp_path / "tests").mkdir()
    body = ['    """', *["    words"] * 50, '    """', *["    x = 1"] * statements]
    (tmp_path / "tests" / "long.py").write_text("\n".join(["def talk():", *body]))
    assert rules.long_functions(tmp_path) == found
