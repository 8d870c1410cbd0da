"""A command whose options are the fields of a dataclass."""

from dataclasses import dataclass
from typing import Annotated

import typer
from typer.testing import CliRunner

from tral_fsm.cli.together import taking


@dataclass(frozen=True, kw_only=True)
class Two:
    first: Annotated[int, typer.Option(min=1, help="a number")] = 3
    second: Annotated[str, typer.Option("--other")] = "b"


def run(*arguments: str) -> tuple[int, str]:
    app = typer.Typer()

    @app.command()
    @taking(Two)
    def show(context: typer.Context, given: Two) -> None:
        """Shows two."""
        typer.echo(given)

    done = CliRunner().invoke(app, list(arguments))
    return done.exit_code, done.output


def test_fields_keep_their_defaults() -> None:
    assert run() == (0, "Two(first=3, second='b')\n")


def test_a_field_is_an_option_with_the_name_of_its_annotation() -> None:
    assert run("--other", "c", "--first", "5") == (0, "Two(first=5, second='c')\n")


def test_the_bounds_of_an_option_hold() -> None:
    code, told = run("--first", "0")
    assert code == 2
    assert "greater than or equal to 1" in " ".join(told.split())


def test_the_help_is_that_of_the_function_and_of_the_fields() -> None:
    told = run("--help")[1]
    assert "Shows two." in told
    assert "a number" in told
