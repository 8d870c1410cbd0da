"""`tral courses`: families of courses, courses by name and course files: as a list, as pictures or as files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tral_env.errors import ConfigError
from tral_fsm.cli.console import refuse_both, was_given
from tral_fsm.cli.files import suffix_of
from tral_fsm.evaluation.choices import check_families
from tral_fsm.evaluation.files import prepare_folder, write_figure

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.table import Column

    from tral_env.course.layout import Course
    from tral_env.course.plan import Plan

_SUFFIXES = (".png", ".json")


def command(
    context: typer.Context,
    scenario: Annotated[str | None, typer.Option(help="Family of courses; default: all.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the course of a family; it is told, drawn or written.")] = 0,
    course: Annotated[
        str | None, typer.Option(help="One course instead: its name, or a course file. It is checked.")
    ] = None,
    randomization: Annotated[
        str, typer.Option(help="Level of the drives: hard, or a file with hard_courses, draws harder courses.")
    ] = "default",
    out: Annotated[
        Path | None, typer.Option(dir_okay=False, help="Draw the course into this .png, or write it into this .json.")
    ] = None,
) -> None:
    """List families and courses, tell or draw the courses of a seed, check a course file, or write one.

    A seed gives the same course here as in `tral drive` with the same `--randomization`.
    """
    from tral_env.randomization import level

    hard = level(randomization).hard_courses
    if scenario is not None:
        check_families([scenario])
    for option in ("scenario", "seed", "randomization"):
        refuse_both(context, option, "course")
    if course is not None:
        _one(course, out)
    elif out is None and not was_given(context, "seed") and not was_given(context, "randomization"):
        _list(scenario)
    elif out is not None and suffix_of(out, _SUFFIXES) == ".json":
        if scenario is None:
            raise ConfigError(f"--out {out}: a course file holds one course, so --scenario or --course is needed")
        _save(seeded_course(scenario, seed, hard=hard), out)
    else:
        from tral_env.course.generate import SCENARIOS

        families = [scenario] if scenario else list(SCENARIOS)
        drawn = {family: seeded_course(family, seed, hard=hard) for family in families}
        if out is None:
            _tell(drawn, seed)
        else:
            _draw_families(drawn, seed, out)


def _tell(courses: Mapping[str, Course], seed: int) -> None:
    """A line for the course of each family: its route, and how many of each thing are in it."""
    from rich.console import Console
    from rich.table import Table

    from tral_env.course.geometry import build_plan

    table = Table("family", *(_column(each) for each in ("route", *_COUNTED)), title_justify="left")
    table.title = f"Courses of seed {seed}"
    for family, course in courses.items():
        table.add_row(family, f"{build_plan(course).length:.1f} m", *map(str, _counts(course)))
    Console().print(table)
    typer.echo(f"Draw one: tral courses --scenario {family} --seed {seed} --out {family}.png")
    typer.echo(f"Drive one: tral drive --scenario {family} --seed {seed}")


_COUNTED = ("turns", "doors", "cupboards", "boxes", "gates")


def _counts(course: Course) -> list[int]:
    """Number of each of `_COUNTED`."""
    turns = sum(segment.then in ("left", "right") for segment in course.segments)
    things = ("doors", "cupboards", "obstacles", "gates")
    return [turns, *(sum(len(getattr(segment, name)) for segment in course.segments) for name in things)]


def _column(name: str) -> Column:
    from rich.table import Column

    return Column(name, justify="right")


def _draw_families(courses: Mapping[str, Course], seed: int, out: Path) -> None:
    from tral_env.course.geometry import build_plan

    _draw({f"{family}, seed {seed}": build_plan(one) for family, one in courses.items()}, out)


def _list(scenario: str | None) -> None:
    from tral_env.course.generate import SCENARIOS
    from tral_env.course.layout import Course, example_names, example_path

    _table("family", "Families of courses", {scenario: SCENARIOS[scenario]} if scenario else dict(SCENARIOS))
    if scenario is None:
        examples = {name: Course.load(example_path(name)).description for name in example_names()}
        _table("name", "Courses with a name", examples)
    typer.echo("Tell one: tral courses --scenario office --seed 7")
    typer.echo("Draw one: tral courses --scenario office --seed 7 --out office.png")
    if scenario is None:
        typer.echo("Drive one: tral drive --course l_shape")


def _table(heading: str, title: str, descriptions: Mapping[str, str]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(heading, "course", title=title, title_justify="left")
    for name, description in descriptions.items():
        table.add_row(name, description)
    Console().print(table)


def _one(source: str, out: Path | None) -> None:
    """Check a course, and draw or write it if `out` says so."""
    from tral_env.course.geometry import build_plan
    from tral_env.options import as_course

    suffix = None if out is None else suffix_of(out, _SUFFIXES)
    course = as_course(source)
    assert course is not None, "a name or a path gives a course"
    plan = build_plan(course)
    if out is None:
        counts = f"{len(plan.gate_id)} gates" if len(plan.gate_id) != 1 else "1 gate"
        typer.echo(f"{source}: can be driven: '{course.name}', a route of {plan.length:.1f} m, {counts}")
    elif suffix == ".json":
        _save(course, out)
    else:
        _draw({course.name: plan}, out)


def _draw(plans: Mapping[str, Plan], out: Path) -> None:
    from tral_fsm.report.courses import course_sheet

    prepare_folder(out.parent)
    write_figure(out, course_sheet(plans), 110)
    typer.echo(f"Written: {out}")


def _save(course: Course, out: Path) -> None:
    prepare_folder(out.parent)
    course.save(out)
    typer.echo(f"Written: {out}")


def seeded_course(scenario: str, seed: int, *, hard: bool = False) -> Course:
    """The course that the env generates at `reset(seed=seed)`; `hard`: with randomization "hard"."""
    from gymnasium.utils import seeding

    from tral_env.course.generate import generate

    # The env draws its course from this generator before it draws anything else.
    return generate(scenario, seeding.np_random(seed)[0], hard=hard)
