"""`tral fsm`: check, convert, draw and begin machine files; list the states and conditions."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from tral_env.atomic import is_device, write_bytes
from tral_env.errors import ConfigError, MachineError, nearest
from tral_fsm.cli.console import BAD_USAGE, FAILED, Guarded
from tral_fsm.cli.files import suffix_of
from tral_fsm.cli.fsm_states import command as states_command
from tral_fsm.evaluation.files import prepare_folder

app = typer.Typer(
    cls=Guarded,
    no_args_is_help=True,
    help="Check, convert, draw and begin machine files; list the states and conditions.",
    epilog="Exit codes: 0 success, 1 a file is no machine that can run, 2 bad usage.",
)
app.command("states")(states_command)

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
_PICTURES = (".svg", ".png")


@app.command("check")
def check(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE...", help="Machine files, or names of packaged machines.")
    ],
    as_json: AsJson = False,
) -> None:
    """Check machines as `tral drive` does, and tell every problem with its place in the file.

    The problems are what the command is asked for, so they go to stdout. A file that cannot be read goes to stderr.
    """
    found = [_checked(file) for file in files]
    if as_json:
        report = {"ok": all(entry["ok"] for entry in found), "files": found}
        typer.echo(json.dumps(report, indent=2))
    for entry in found if not as_json else ():
        if entry["ok"]:
            typer.echo(f"{entry['file']}: fine: {_count(entry, 'states')}, {_count(entry, 'transitions')}")
        for note in entry["notes"]:
            typer.echo(f"{entry['file']}: note: {note}")
        for problem in entry["problems"]:
            place = problem["place"] or problem["pointer"]
            told = ": ".join(text for text in (entry["file"], place, problem["message"]) if text)
            typer.echo(told, err=not entry["readable"])
    if any(not entry["readable"] for entry in found):
        raise typer.Exit(BAD_USAGE)
    if not all(entry["ok"] for entry in found):
        raise typer.Exit(FAILED)


def _checked(file: str) -> dict[str, Any]:
    """Result for one file, as plain values."""
    from tral_fsm import FormatError
    from tral_fsm.formats.library import load_with_notes
    from tral_fsm.formats.umlet.writer import lost_titles

    entry: dict[str, Any] = {"file": file, "ok": False, "readable": True, "problems": [], "notes": []}
    try:
        machine, notes = load_with_notes(file)
    except FormatError as error:
        entry["problems"] = [{"pointer": p.pointer, "place": p.place, "message": p.message} for p in error.problems]
    except MachineError as error:
        message = str(error).removeprefix(f"{file}: ")
        entry |= {"readable": False, "problems": [{"pointer": "", "place": "", "message": message}]}
    else:
        entry |= {
            "ok": True,
            "name": machine.name,
            "states": len(machine.states),
            "transitions": len(machine.transitions),
            "notes": [*notes, *lost_titles(machine)],
        }
    return entry


def _count(entry: dict[str, Any], what: str) -> str:
    return f"{entry[what]} {what if entry[what] != 1 else what.removesuffix('s')}"


@app.command("convert")
def convert(
    source: Annotated[str, typer.Argument(metavar="IN", help="Machine file, or name of a packaged machine.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="File that is written; an existing one is replaced.")],
    to: Annotated[
        str | None,
        typer.Option("--to", help="Format: json, uxf, scxml, mermaid, plantuml; default: that of OUT's suffix."),
    ] = None,
) -> None:
    """Write a machine in another format. If that fails, an existing file stays as it is."""
    from tral_fsm.formats import FORMATS, by_suffix, write

    if to is None:
        try:
            to = by_suffix(out.suffix)
        except MachineError as error:
            raise ConfigError(f"{out}: {error}; or give --to") from None
    elif to not in FORMATS or FORMATS[to].writes is None:
        written = [name for name, entry in FORMATS.items() if entry.writes is not None]
        raise ConfigError(f"--to {to}: {nearest(to, written)}")
    from tral_fsm import load_machine
    from tral_fsm.formats.umlet.writer import lost_titles

    machine = load_machine(source)
    text = write(machine, to)
    _replace(out, text.encode("utf-8"), f" ({FORMATS[to].description})")
    for note in lost_titles(machine) if to == "uxf" else ():
        typer.echo(f"Note: {note}", err=True)


@app.command("draw")
def draw(
    source: Annotated[str, typer.Argument(metavar="FILE", help="Machine file, or name of a packaged machine.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="File of the picture: .svg or .png.")],
    direction: Annotated[
        Literal["right", "down"] | None,
        typer.Option(help="Direction of most arrows; default: the one with the smaller picture."),
    ] = None,
) -> None:
    """Draw a machine: its states, its transitions, and the machines inside it."""
    suffix = suffix_of(out, _PICTURES)
    from tral_fsm import load_machine
    from tral_fsm.draw.picture import picture
    from tral_fsm.draw.png import png, scale_of
    from tral_fsm.draw.svg import svg

    drawn = picture(load_machine(source), load_machine, direction)
    _replace(out, png(drawn) if suffix == ".png" else svg(drawn).encode("utf-8"))
    if suffix == ".png" and scale_of(drawn) < 0.5:
        typer.echo(f"The picture of {drawn.width} x {drawn.height} px is too large for a .png: try .svg", err=True)


@app.command("new")
def new(
    name: Annotated[Path, typer.Argument(metavar="NAME", help="File: .json (also without suffix), .uxf or .scxml.")],
    force: Annotated[bool, typer.Option(help="Replace an existing file.")] = False,
) -> None:
    """Write a small machine that drives corridors, as a start for your own; its labels explain its parts."""
    from tral_fsm.cli.fsm_new import starting_point
    from tral_fsm.formats import FORMATS, by_suffix, write

    if name.name in ("", ".", ".."):
        raise ConfigError(f"got {str(name)!r}: name a file")
    out = name if name.suffix else name.with_name(f"{name.name}.json")
    suffixes = [suffix for entry in FORMATS.values() if entry.reads and entry.writes for suffix in entry.suffixes]
    if out.suffix.lower() not in suffixes:
        raise ConfigError(f"{out}: got suffix '{out.suffix}': {nearest(out.suffix.lower(), suffixes)}")
    if out.exists() and not force:
        raise ConfigError(f"{out}: is there already: choose another name, or --force to replace it")
    _replace(out, write(starting_point(out.stem), by_suffix(out.suffix)).encode("utf-8"))
    typer.echo(f"Drive it: tral drive --policy {out}\nDraw it: tral fsm draw {out} -o {out.stem}.svg")


def _replace(out: Path, content: bytes, what: str = "") -> None:
    """Replace a file at once, and say so: on stderr if the content may go to stdout."""
    if out.is_dir():
        raise ConfigError(f"{out}: is a folder: name a file in it")
    if not is_device(out):
        prepare_folder(out.parent, str(out))
    try:
        write_bytes(out, content)
    except OSError as error:
        raise ConfigError(f"{out}: cannot be written: {error.strerror}") from error
    typer.echo(f"Written: {out}{what}", err=is_device(out))
