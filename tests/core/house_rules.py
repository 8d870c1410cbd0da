"""The rules of the house, told about a mapping of imports: module -> full names of what it imports.

Rules of `LOADING` are told about the imports that happen, without those for types alone.

A room is a folder directly below `tral_env` or `tral_fsm`, or a module beside those folders. A rule is a function from
imports to violations, each a line of text; no rule names a file, except modules that are rooms of their own.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Iterator, Mapping, Set
from pathlib import Path

Imports = Mapping[str, Set[str]]
Rule = Callable[[Imports], list[str]]

PLAIN = (
    "interface",
    "geometry",
    "se2",
    "errors",
    "installation",
    "checks",
    "json_text",
    "toml_text",
    "validation_text",
    "arrays",
    "speed_control",
)
WAIST = {f"tral_env.{room}" for room in PLAIN}
WAIST_NEEDS = {"numpy", "gymnasium.spaces"}

PHYSICS = {"mujoco"}
HEAVY = PHYSICS | {"torch", "stable_baselines3", "matplotlib"}
LAWS = {f"tral_env.{room}" for room in ("sensors", "actuation", "task", "noise", "config")}
LEARNED = {f"tral_env.{room}" for room in ("learner", "learned", "policy_file", "tensors")}
ON_THE_CAR = LEARNED | {f"tral_env.{room}" for room in ("hardware", "recording", "ros")}
ACTUATOR = "tral_env.hardware.actuator"
CAR_NEEDS = (
    WAIST
    | ON_THE_CAR
    | LAWS - {"tral_env.task"}
    | {f"tral_env.{room}" for room in ("perception", "calibration", "yaml_text", "atomic", "assets", "randomization")}
)
TWIN_NEEDS = WAIST | {
    f"tral_env.{room}"
    for room in ("world", "options", "config", "sensors", "course", "hardware", "simulation", "perception")
}
OPTIONS_NEED = {
    f"tral_env.{room}" for room in ("config", "randomization", "course", "perception", "calibration", "learner")
}
SHELLS = {f"tral_env.{room}" for room in ("env", "vector_env", "sb3")}
STEPS = {"tral_env.simulation", "tral_env.world", "tral_env.decisions"} | SHELLS
SIMULATION_NEEDS = (
    WAIST
    | LAWS - {"tral_env.task"}
    | {f"tral_env.{room}" for room in ("simulation", "course", "perception", "calibration", "randomization", "assets")}
)
WORLD_NEEDS = {f"tral_env.{room}" for room in ("config", "options", "task", "course", "randomization", "simulation")}
POLICY_FLOORS = tuple(
    f"tral_fsm.{room}"
    for room in ("definition", "estimation", "control", "states", "conditions", "runtime", "draw", "formats")
)
"""Each of the rooms of a policy imports of the others only those before it."""
POLICY = set(POLICY_FLOORS)
DRIVES = STEPS | {f"tral_fsm.{room}" for room in ("runtime", "policies", "live", "bench")}


def room_of(module: str) -> str:
    """The room of one of our modules: its first two names."""
    return ".".join(module.split(".")[:2])


def is_ours(name: str) -> bool:
    return name.split(".")[0] in ("tral_env", "tral_fsm")


def _outside(imports: Imports, rooms: Set[str], allowed: Set[str]) -> list[str]:
    """What rooms import of our own rooms beyond the allowed ones."""
    return [
        f"{module} imports {name}"
        for module, names in sorted(imports.items())
        if room_of(module) in rooms
        for name in sorted(names)
        if is_ours(name) and room_of(name) not in allowed | {room_of(module)}
    ]


def _among(imports: Imports, rooms: Set[str], forbidden: Set[str]) -> list[str]:
    """What rooms import of forbidden rooms or distributions."""
    return [
        f"{module} imports {name}"
        for module, names in sorted(imports.items())
        if room_of(module) in rooms
        for name in sorted(names)
        if (room_of(name) if is_ours(name) else name.split(".")[0]) in forbidden - {room_of(module)}
    ]


def _reaches(imports: Imports, module: str) -> set[str]:
    """Distributions that a module imports, itself or by what it imports; a module brings the packages that hold it."""
    seen, todo, found = set(), [module], set()
    while todo:
        name = todo.pop()
        if not is_ours(name):
            found.add(name.split(".")[0])
        elif name not in seen:
            seen.add(name)
            todo += [*imports.get(name, ()), name.rpartition(".")[0]] if "." in name else imports.get(name, ())
    return found


def the_waist_needs_numpy_and_spaces_alone(imports: Imports) -> list[str]:
    return [
        f"{module} imports {name}"
        for module in sorted(WAIST & imports.keys())
        for name in sorted(imports[module])
        if name not in WAIST | WAIST_NEEDS and name.split(".")[0] not in sys.stdlib_module_names | {"numpy"}
    ]


def laws_need_the_waist_config_and_course(imports: Imports) -> list[str]:
    rooms = {"tral_env.sensors", "tral_env.actuation", "tral_env.task"}
    return _outside(imports, rooms, WAIST | {"tral_env.config", "tral_env.noise", "tral_env.course"})


def laws_reach_no_physics(imports: Imports) -> list[str]:
    return [
        f"{module} reaches {name}"
        for module in sorted(imports)
        if room_of(module) in LAWS | WAIST
        for name in sorted(_reaches(imports, module) & PHYSICS)
    ]


def calibration_needs_the_waist_config_and_perception(imports: Imports) -> list[str]:
    return _outside(
        imports,
        {"tral_env.calibration"},
        WAIST | {f"tral_env.{room}" for room in ("config", "perception", "atomic", "yaml_text")},
    )


def calibration_reaches_no_physics(imports: Imports) -> list[str]:
    return [
        f"{module} reaches {name}"
        for module in sorted(imports)
        if room_of(module) == "tral_env.calibration"
        for name in sorted(_reaches(imports, module) & PHYSICS)
    ]


def options_know_what_they_set_and_nothing_that_steps(imports: Imports) -> list[str]:
    return _outside(imports, {"tral_env.options"}, WAIST | OPTIONS_NEED)


def one_module_of_course_and_one_of_perception_meet_physics(imports: Imports) -> list[str]:
    found = []
    for room in ("tral_env.course", "tral_env.perception"):
        users = [m for m, names in sorted(imports.items()) if room_of(m) == room and _top(names) & PHYSICS]
        found += [f"{room} meets physics in {', '.join(users)}"] if len(users) > 1 else []
    return found


def _top(names: Set[str]) -> set[str]:
    return {name.split(".")[0] for name in names}


def course_needs_the_waist_and_config(imports: Imports) -> list[str]:
    return _outside(
        imports, {"tral_env.course"}, WAIST | {f"tral_env.{room}" for room in ("config", "assets", "atomic")}
    )


def recordings_need_the_waist_and_atomic(imports: Imports) -> list[str]:
    return _outside(imports, {"tral_env.recording"}, WAIST | {"tral_env.atomic"})


def the_car_needs_little(imports: Imports) -> list[str]:
    return _outside(imports, ON_THE_CAR, CAR_NEEDS)


def the_car_reaches_nothing_heavy(imports: Imports) -> list[str]:
    return [
        f"{module} reaches {name}"
        for module in sorted(imports)
        if room_of(module) in ON_THE_CAR
        for name in sorted(_reaches(imports, module) & HEAVY)
    ]


def randomization_needs_the_waist_and_config(imports: Imports) -> list[str]:
    return _outside(imports, {"tral_env.randomization"}, WAIST | {"tral_env.config", "tral_env.yaml_text"})


def the_world_knows_the_simulation_and_no_shell(imports: Imports) -> list[str]:
    return _outside(imports, {"tral_env.world"}, WAIST | WORLD_NEEDS)


def the_actuator_reaches_the_standard_library_and_the_buses_alone(imports: Imports) -> list[str]:
    # Its process runs no `tral_env/__init__`: see `tral_env.hardware.actuator.__main__`.
    loaded = {module: names for module, names in imports.items() if module != "tral_env"}
    return [
        f"{module} reaches {name}"
        for module in sorted(loaded)
        if module.startswith(ACTUATOR)
        for name in sorted(_reaches(loaded, module) - sys.stdlib_module_names - {"smbus2", "serial"})
    ]


def simulation_knows_no_world(imports: Imports) -> list[str]:
    return _outside(imports, {"tral_env.simulation"}, SIMULATION_NEEDS)


def the_twin_knows_the_world_and_the_car(imports: Imports) -> list[str]:
    return _outside(imports, {"tral_env.twin"}, TWIN_NEEDS)


def shells_know_the_world_and_not_the_simulation(imports: Imports) -> list[str]:
    return _among(imports, SHELLS, {"tral_env.simulation"})


def the_two_environments_do_not_know_each_other(imports: Imports) -> list[str]:
    env, vector = {"tral_env.env"}, {"tral_env.vector_env"}
    return _among(imports, env, vector) + _among(imports, vector, env)


def the_environment_knows_no_state_machine(imports: Imports) -> list[str]:
    return [
        f"{module} imports {name}"
        for module, names in sorted(imports.items())
        if module.split(".")[0] == "tral_env"
        for name in sorted(names)
        if name.split(".")[0] == "tral_fsm"
    ]


def policies_know_the_waist_alone(imports: Imports) -> list[str]:
    """The runtime, which runs policies, also knows trained ones."""
    runs = {"tral_fsm.runtime"}
    return _outside(imports, POLICY - runs, WAIST | POLICY) + _outside(imports, runs, WAIST | POLICY | LEARNED)


def policies_are_built_floor_by_floor(imports: Imports) -> list[str]:
    return [
        problem
        for place, room in enumerate(POLICY_FLOORS)
        for problem in _among(imports, {room}, set(POLICY_FLOORS[place:]))
    ]


def a_person_at_the_wheel_knows_the_waist_alone(imports: Imports) -> list[str]:
    return _outside(imports, {"tral_fsm.teleop"}, WAIST)


def pictures_of_machines_know_the_definition_alone(imports: Imports) -> list[str]:
    return _among(imports, {"tral_fsm.draw"}, POLICY - {"tral_fsm.definition"})


LAST = ("tral_fsm.report", "tral_fsm.programs", "tral_fsm.cli")
"""Rooms that only the rooms behind them in this order import."""


def nobody_imports_what_comes_last(imports: Imports) -> list[str]:
    """Scripts of benchmarks/ are programs too: they import the report and programs, but not the CLI."""
    rooms = {room_of(module) for module in imports}
    scripts = {room for room in rooms if room.startswith("benchmarks")}
    return [
        problem
        for place, room in enumerate(LAST)
        for problem in _among(imports, rooms - set(LAST[place:]) - (set() if room == LAST[-1] else scripts), {room})
    ]


def report_drives_nothing(imports: Imports) -> list[str]:
    return _among(imports, {"tral_fsm.report"}, DRIVES)


def report_reaches_no_physics(imports: Imports) -> list[str]:
    return [
        f"{module} reaches {name}"
        for module in sorted(imports)
        if room_of(module) == "tral_fsm.report"
        for name in sorted(_reaches(imports, module) & PHYSICS)
    ]


def no_circle_of_rooms(imports: Imports) -> list[str]:
    rooms: dict[str, set[str]] = {}
    for module, names in imports.items():
        if module in ("tral_env", "tral_fsm"):
            continue  # the front doors show what lies in the rooms
        ours = {room_of(name) for name in names if is_ours(name)} - {"tral_env", "tral_fsm", room_of(module)}
        rooms.setdefault(room_of(module), set()).update(ours)
    return _circles(rooms)


def no_circle_of_modules(imports: Imports) -> list[str]:
    return _circles({module: {name for name in names if is_ours(name)} for module, names in imports.items()})


def _circles(graph: Mapping[str, Set[str]]) -> list[str]:
    """Groups of places each of which is reached from each other one."""
    reached = {place: _from(graph, place) for place in graph}
    groups = {
        tuple(sorted({place} | {other for other in reached[place] if place in reached.get(other, ())}))
        for place in graph
        if place in reached[place]
    }
    return [" <-> ".join(group) for group in sorted(groups)]


def _from(graph: Mapping[str, Set[str]], place: str) -> set[str]:
    seen: set[str] = set()
    todo = [place]
    while todo:
        for other in graph.get(todo.pop(), ()):
            if other not in seen:
                seen.add(other)
                todo.append(other)
    return seen


RULES: tuple[Rule, ...] = (
    the_waist_needs_numpy_and_spaces_alone,
    laws_need_the_waist_config_and_course,
    laws_reach_no_physics,
    calibration_needs_the_waist_config_and_perception,
    calibration_reaches_no_physics,
    options_know_what_they_set_and_nothing_that_steps,
    one_module_of_course_and_one_of_perception_meet_physics,
    course_needs_the_waist_and_config,
    recordings_need_the_waist_and_atomic,
    the_car_needs_little,
    the_car_reaches_nothing_heavy,
    randomization_needs_the_waist_and_config,
    the_world_knows_the_simulation_and_no_shell,
    the_actuator_reaches_the_standard_library_and_the_buses_alone,
    simulation_knows_no_world,
    the_twin_knows_the_world_and_the_car,
    shells_know_the_world_and_not_the_simulation,
    the_two_environments_do_not_know_each_other,
    the_environment_knows_no_state_machine,
    policies_know_the_waist_alone,
    policies_are_built_floor_by_floor,
    a_person_at_the_wheel_knows_the_waist_alone,
    pictures_of_machines_know_the_definition_alone,
    nobody_imports_what_comes_last,
    report_drives_nothing,
    report_reaches_no_physics,
    no_circle_of_rooms,
    no_circle_of_modules,
)
LOADING = {
    laws_reach_no_physics,
    calibration_reaches_no_physics,
    the_car_reaches_nothing_heavy,
    the_actuator_reaches_the_standard_library_and_the_buses_alone,
    report_reaches_no_physics,
}


def imports_of(root: Path, *, types: bool = True) -> dict[str, set[str]]:
    """Imports of every module of both packages and of every benchmark, also those inside functions.

    Args:
        root: folder that holds them.
        types: whether imports under `if TYPE_CHECKING` count.
    """
    folders = ("tral_env", "tral_fsm", "benchmarks")
    trees = {_module(path, root): path for folder in folders for path in (root / folder).rglob("*.py")}
    return {
        module: {_known(name, trees) for name in _imported(path, root, types)} - {module}
        for module, path in trees.items()
    }


def _module(path: Path, root: Path) -> str:
    names = path.relative_to(root).with_suffix("").parts
    return ".".join(names[:-1] if names[-1] == "__init__" else names)


def _imported(path: Path, root: Path, types: bool) -> Iterator[str]:
    """Full names of all that a file imports."""
    package = path.relative_to(root).parent.parts
    todo: list[ast.AST] = [ast.parse(path.read_text("utf-8"))]
    while todo:
        node = todo.pop()
        for_types = isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        todo += node.orelse if for_types and not types else ast.iter_child_nodes(node)
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            # one dot is the file's own folder, each more the folder above
            above = package[: len(package) + 1 - node.level] if node.level else ()
            yield from (".".join([*above, *filter(None, [node.module]), alias.name]) for alias in node.names)


def _known(name: str, modules: Set[str] | Mapping[str, object]) -> str:
    """The module of ours that a name lies in; a name of somebody else's as it is."""
    while is_ours(name) and name not in modules:
        name = name.rpartition(".")[0]
    return name


ARRAYS = {"Array", "Index", "Flags", "Image", "NDArray", "FloatArray"}


def array_dataclasses_that_compare(root: Path) -> list[str]:
    """Dataclasses that hold arrays and have an ``==`` of their own, which fails: an array has no truth value."""
    return [
        f"{path.relative_to(root)}: {node.name}"
        for package in ("tral_env", "tral_fsm")
        for path in sorted((root / package).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ClassDef) and _holds_arrays(node)
        for made in map(ast.unparse, node.decorator_list)
        if made.startswith("dataclass") and "eq=False" not in made
    ]


def _holds_arrays(node: ast.ClassDef) -> bool:
    return any(
        isinstance(name, ast.Name) and name.id in ARRAYS
        for field in node.body
        if isinstance(field, ast.AnnAssign) and "compare=False" not in ast.unparse(field)
        for name in ast.walk(field.annotation)
    )


PROGRAMS = ("tral_env", "tral_fsm", "benchmarks", "tests")
MAX_FUNCTION_LINES = 40


def long_functions(root: Path) -> list[str]:
    """Functions whose body has more than 40 lines. The docstring does not count."""
    return [
        f"{path.relative_to(root)}: {node.name} has {_lines(node)} lines"
        for folder in PROGRAMS
        for path in sorted((root / folder).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and _lines(node) > MAX_FUNCTION_LINES
    ]


def _lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines from the first statement behind the docstring to the last."""
    body = function.body[1:] if ast.get_docstring(function) is not None else function.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0
