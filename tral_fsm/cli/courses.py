"""`tral courses`: the families of courses, as a list, as pictures or as course files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tral_env.atomic import write_bytes
from tral_env.errors import ConfigError
from tral_fsm.cli.files import suffix_of
from tral_fsm.evaluation.choices import check_families
from tral_fsm.evaluation.files import prepare_folder, write_figure

if TYPE_CHECKING:
    from tral_env.course.layout import Course

_SUFFIXES = (".png", ".json")


def command(
    scenario: Annotated[str | None, typer.Option(help="Family of courses; default: all.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the course.")] = 0,
    out: Annotated[
        Path | None, typer.Option(dir_okay=False, help="Draw the course into this .png, or write it into this .json.")
    ] = None,
) -> None:
    """List the families of courses, draw courses, or write a course file.

    A seed gives the same course here as in `tral drive`.
    """
    from tral_env.course.generate import SCENARIOS

    if scenario is not None:
        check_families([scenario])
    if out is None:
        _list({scenario: SCENARIOS[scenario]} if scenario else dict(SCENARIOS))
        return
    families = [scenario] if scenario else list(SCENARIOS)
    if suffix_of(out, _SUFFIXES) == ".json":
        _export(scenario, seed, out)
    else:
        prepare_folder(out.parent)
        from tral_env.course.geometry import build_plan
        from tral_fsm.report.courses import course_sheet

        plans = {f"{family}, seed {seed}": build_plan(seeded_course(family, seed)) for family in families}
        write_figure(out, course_sheet(plans), 110)
    typer.echo(f"Written: {out}")


def _list(families: dict[str, str]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("family", "course", title="Families of courses", title_justify="left")
    for name, description in families.items():
        table.add_row(name, description)
    Console().print(table)
    typer.echo("Draw one: tral courses --scenario office --seed 7 --out office.png")


def _export(scenario: str | None, seed: int, out: Path) -> None:
    if scenario is None:
        raise ConfigError(f"--out {out}: a course file holds one course, so --scenario is needed")
    prepare_folder(out.parent)
    write_bytes(out, seeded_course(scenario, seed).to_json().encode("utf-8"))


def seeded_course(scenario: str, seed: int) -> Course:
    """The course that the env generates at `reset(seed=seed)`."""
    from gymnasium.utils import seeding

    from tral_env.course.generate import generate

    # The env draws its course from this generator before it draws anything else.
    return generate(scenario, seeding.np_random(seed)[0])
