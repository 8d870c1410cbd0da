"""`tral doctor`: which parts of this computer work, and the remedy for each that does not."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import asdict, dataclass
from importlib import metadata
from typing import Annotated

import typer

from tral_env.errors import MachineError, RenderError
from tral_env.installation import CPU_TORCH, DISTRIBUTION, installed
from tral_env.perception import opengl
from tral_env.recording.video import encoder
from tral_fsm.cli.console import MACHINE_LACKS
from tral_fsm.definition import plugins

_FOR_TESTS = "dev"
"""The extra that is not examined: it brings the tools of those that change this package."""
_REQUIREMENT = re.compile(r"(?P<name>[\w.-]+)[^;]*(;.*extra == ['\"](?P<extra>[\w-]+)['\"])?")
_PROBE_TIMEOUT_S = 60.0
_MAX_LENGTH = 100
"""Number of characters of a message that are shown."""

_NO_OPENGL = (
    "install OpenGL that needs no screen (Debian, Ubuntu: apt install libegl1 libgl1-mesa-dri), "
    "or do without it: tral drive --camera projected --no-video"
)

_NO_MUJOCO = "pip install --force-reinstall 'mujoco>=4.0'"
"""An upgrade from MuJoCo 3 in place removes files that version 4 has in mujoco-core, so that it cannot be imported."""

_PROBE = """
import time
import mujoco
XML = '''<mujoco><visual><quality shadowsize="0" offsamples="4"/></visual><worldbody><light pos="0 0 3"/>
<geom type="plane" size="5 5 1"/><geom type="box" size=".2 .1 .1" pos="1 0 .1"/></worldbody></mujoco>'''
model = mujoco.MjModel.from_xml_string(XML)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 480, 640) as renderer:
    times = []
    for _ in range(12):
        start = time.perf_counter()
        renderer.update_scene(data)
        image = renderer.render()
        times.append(time.perf_counter() - start)
    assert image.max() > 0, "the image is black"
    print("ms", 1000 * sorted(times)[len(times) // 2])
"""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """The result of one check."""

    topic: str
    name: str
    ok: bool
    needed: bool
    """Whether the core needs it."""
    detail: str
    remedy: str = ""


def command(
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON and nothing else.")] = False,
) -> None:
    """Check this computer: packages, OpenGL, video encoder, plugins and extras, each with its remedy.

    The exit code is 0 if the core works, which is driving with projected markers, else 3.
    """
    findings = examine()
    core = all(finding.ok for finding in findings if finding.needed)
    if as_json:
        typer.echo(json.dumps({"core_works": core, "findings": [asdict(finding) for finding in findings]}, indent=2))
    else:
        _show(findings)
    if not core:
        raise typer.Exit(MACHINE_LACKS)


def examine() -> list[Finding]:
    """Check Python, packages, physics, OpenGL, encoder, plugins and extras."""
    python = ".".join(str(part) for part in sys.version_info[:3])
    core, extras = _packages()
    return [
        Finding(topic="core", name="python", ok=sys.version_info >= (3, 11), needed=True, detail=python),
        *core,
        _physics(),
        *_opengl(),
        _encoder(),
        *_plugins(),
        *extras,
    ]


def _packages() -> tuple[list[Finding], list[Finding]]:
    """Whether each package is there that the installed distribution asks for: for the core, and for extras."""
    core, extras = [_package(DISTRIBUTION, "core", installed().command())], list[Finding]()
    if not core[0].ok:
        return core, extras
    for text in metadata.requires(DISTRIBUTION) or ():
        found = _REQUIREMENT.match(text)
        assert found is not None, text
        extra, remedy = found["extra"], f"pip install '{text.partition(';')[0].strip()}'"
        if found["name"] == "torch":
            remedy = f"{remedy}; {CPU_TORCH}"
        if extra is None:
            core.append(_package(found["name"], "core", remedy))
        elif extra != _FOR_TESTS:
            extras.append(_package(found["name"], f"extra {extra}", remedy, needed=False))
    return core, extras


def _package(name: str, topic: str, remedy: str, needed: bool = True) -> Finding:
    try:
        detail, ok = metadata.version(name), True
    except metadata.PackageNotFoundError:
        detail, ok = "not installed", False
    return Finding(topic=topic, name=name, ok=ok, needed=needed, detail=detail, remedy="" if ok else remedy)


def _python(code: str, **environment: str) -> tuple[bool, str]:
    """Run code in a new Python: whether it succeeded, and the last line that it printed."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            timeout=_PROBE_TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False, f"no answer within {_PROBE_TIMEOUT_S:g} s"
    said = (done.stdout if done.returncode == 0 else done.stderr).strip().splitlines()
    return done.returncode == 0, _shortened(said[-1]) if said else f"exit code {done.returncode}"


def _shortened(text: str) -> str:
    return text if len(text) <= _MAX_LENGTH else f"{text[: _MAX_LENGTH - 3]}..."


_DRIVE_A_SECOND = """
import gymnasium
env = gymnasium.make("tral_env:TralCorridor-v0", scenario="straight", camera="projected")
env.reset(seed=0)
import time
start = time.perf_counter()
for _ in range(80):
    env.step(env.action_space.low * 0)
print("steps/s", 80 / (time.perf_counter() - start))
"""


def _physics() -> Finding:
    ok, said = _python(_DRIVE_A_SECOND, MUJOCO_GL="disable")
    detail = f"{float(said.split()[-1]):.0f} steps/s" if ok else said
    remedy = "" if ok else installed().command(options="--force-reinstall --no-deps")
    if not ok and not _python("import mujoco")[0]:
        remedy = _NO_MUJOCO
    return Finding(topic="core", name="env without OpenGL", ok=ok, needed=True, detail=detail, remedy=remedy)


def _opengl() -> list[Finding]:
    findings = []
    for backend in opengl.backends():
        ok, said = _python(_PROBE, MUJOCO_GL=backend)
        detail = f"{float(said.split()[-1]):.1f} ms for a frame of 640 x 480" if ok else said
        remedy = "" if ok else opengl.NEEDS.get(backend, _NO_OPENGL)
        findings.append(Finding(topic="OpenGL", name=backend, ok=ok, needed=False, detail=detail, remedy=remedy))
    works = [finding.name for finding in findings if finding.ok]
    now = opengl.backend_in_use()
    remedy = f"export MUJOCO_GL={works[0]}" if works else _NO_OPENGL
    if now in works:
        remedy = ""
    used = Finding(topic="OpenGL", name="in use", ok=not remedy, needed=False, detail=now, remedy=remedy)
    return [*findings, used]


def _encoder() -> Finding:
    try:
        detail, remedy = encoder(), ""
    except RenderError as error:
        told, _, remedy = str(error).rpartition("): ")  # what the loader says of a library may hold colons too
        detail = f"{told})"
    return Finding(topic="video", name="encoder", ok=not remedy, needed=False, detail=detail, remedy=remedy)


def _plugins() -> list[Finding]:
    """Load each distribution that brings states or conditions: one that fails stops every machine."""
    findings = []
    for entry in metadata.entry_points(group=plugins.GROUP):
        try:
            detail, ok = plugins.load(entry), True
        except MachineError as error:
            detail, ok = str(error), False
        remedy = "" if ok else "mend or uninstall that distribution"
        findings.append(Finding(topic="plugin", name=entry.name, ok=ok, needed=True, detail=detail, remedy=remedy))
    none = Finding(
        topic="plugin", name="-", ok=True, needed=False, detail=f"no entry point of the group {plugins.GROUP}"
    )
    return findings or [none]


def _show(findings: list[Finding]) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title="tral doctor", title_justify="left")
    for heading in ("", "what", "found", "remedy"):
        table.add_column(heading, overflow="fold")  # a long word is folded: a remedy is copied whole
    for i, finding in enumerate(findings):
        if i and finding.topic != findings[i - 1].topic:
            table.add_section()
        mark = "[green]ok[/]" if finding.ok else "[red]fails[/]" if finding.needed else "[yellow]no[/]"
        table.add_row(mark, f"{finding.topic}: {finding.name}", escape(finding.detail), escape(finding.remedy))
    Console().print(table)
