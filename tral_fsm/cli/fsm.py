"""`tral fsm`: machine files checked, converted, drawn, begun; what they may consist of."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from tral_env.atomic import is_device, write_bytes
from tral_env.errors import ConfigError, MachineError, nearest
from tral_fsm.cli.console import BAD_USAGE, FAILED, Guarded
from tral_fsm.cli.files import prepare_folder
from tral_fsm.cli.fsm_states import command as states_command

app = typer.Typer(
    cls=Guarded,
    no_args_is_help=True,
    help="Machine files: check, convert, draw, begin one; what they may consist of.",
    epilog="Exit codes: 0 all is well, 1 a file is no machine that can run, 2 bad usage.",
)
app.command("states")(states_command)

AsJson = Annotated[bool, typer.Option("--json", help="One JSON object on stdout and nothing else.")]
_PICTURES = (".svg", ".png")


@app.command("check")
def check(
    files: Annotated[list[str], typer.Argument(metavar="FILE...", help="Files, or names of packaged machines.")],
    as_json: AsJson = False,
) -> None:
    """Check machines as before a drive, and tell all that is wrong with each, with its place."""
    found = [_checked(file) for file in files]
    if as_json:
        report = {"ok": all(entry["ok"] for entry in found), "files": found}
        typer.echo(json.dumps(report, indent=2))
    for entry in found if not as_json else ():
        if entry["ok"]:
            typer.echo(f"{entry['file']}: fine: {_count(entry, 'states')}, {_count(entry, 'transitions')}")
        for problem in entry["problems"]:
            place = problem["place"] or problem["pointer"]
            typer.echo(": ".join(text for text in (entry["file"], place, problem["message"]) if text), err=True)
    if any(not entry["readable"] for entry in found):
        raise typer.Exit(BAD_USAGE)
    if not all(entry["ok"] for entry in found):
        raise typer.Exit(FAILED)


def _checked(file: str) -> dict[str, Any]:
    """The findings about one file, as plain values."""
    from tral_fsm import FormatError, load_machine

    entry: dict[str, Any] = {"file": file, "ok": False, "readable": True, "problems": []}
    try:
        machine = load_machine(file)
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
        }
    return entry


def _count(entry: dict[str, Any], what: str) -> str:
    return f"{entry[what]} {what if entry[what] != 1 else what.removesuffix('s')}"


@app.command("convert")
def convert(
    source: Annotated[str, typer.Argument(metavar="IN", help="File, or name of a packaged machine.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="File that is written, or replaced at once.")],
    to: Annotated[
        str | None, typer.Option("--to", help="Format: json, uxf, scxml, mermaid, plantuml; else by OUT's suffix.")
    ] = None,
) -> None:
    """Write a machine in another format. What is there stays as it is unless all goes well."""
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

    text = write(load_machine(source), to)
    _replace(out, text.encode("utf-8"), f" ({FORMATS[to].description})")


@app.command("draw")
def draw(
    source: Annotated[str, typer.Argument(metavar="FILE", help="File, or name of a packaged machine.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The picture: .svg or .png.")],
    direction: Annotated[
        Literal["right", "down"] | None, typer.Option(help="Where most arrows lead; else as the picture is smaller.")
    ] = None,
) -> None:
    """Draw a machine: its states, when it goes from one to another, and the machines inside it."""
    suffix = out.suffix.lower()
    if suffix not in _PICTURES:
        raise ConfigError(f"--out {out}: got suffix '{out.suffix}': {nearest(suffix, _PICTURES)}")
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
    force: Annotated[bool, typer.Option(help="Replace a file that is there.")] = False,
) -> None:
    """Begin a machine: one that drives corridors, with a word about each part."""
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
    """Write a file at once, and say so: on stderr where the content itself may go to stdout."""
    if out.is_dir():
        raise ConfigError(f"{out}: is a folder: name a file in it")
    if not is_device(out):
        prepare_folder(out.parent, str(out))
    try:
        write_bytes(out, content)
    except OSError as error:
        raise ConfigError(f"{out}: cannot be written: {error.strerror}") from error
    typer.echo(f"Written: {out}{what}", err=is_device(out))
