"""`tral twin` as a command."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from tral_env.twin.faults import INJECTED_FAULTS
from tral_fsm.cli import app
from tral_fsm.cli.console import BAD_USAGE, MACHINE_LACKS

NAME = f"test-{os.getpid()}"
BUS = 950 + int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
"""Workers of pytest do not share a bus."""


def tral(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["twin", *arguments])


@pytest.fixture(scope="module")
def up() -> Iterator[list[str]]:
    """A running twin; gives what the command printed."""
    command = "from tral_fsm.cli import app; app()"
    arguments = ["twin", "up", "--name", NAME, "--scenario", "straight", "--seed", "3", "--bus", str(BUS)]
    program = subprocess.Popen([sys.executable, "-c", command, *arguments], stdout=subprocess.PIPE, text=True)
    assert program.stdout is not None
    lines = []
    for line in program.stdout:
        lines.append(line.strip())
        if line.startswith("The twin runs"):
            break
    yield lines
    assert tral("down", "--name", NAME).exit_code == 0
    assert program.wait(60.0) == 0
    program.stdout.close()
    assert not os.path.lexists(f"/dev/i2c-{BUS}")
    assert NAME not in Path("/proc/mounts").read_text()


def test_up_tells_where_the_devices_are(up: list[str]) -> None:
    told = dict(line.split(": ", 1) for line in up[:-1])
    assert told["clock of the PWM board"] == "28.082 MHz"
    assert told["hall sensor"].endswith(f"{NAME}/hall")
    assert {"I2C bus", "camera", "serial port of board2016", "serial port of ucboard"} <= told.keys()


def test_status_reset_and_faults(up: list[str]) -> None:
    assert tral("fault", "sonar-silent", "--name", NAME, "--seconds", "600").exit_code == 0
    assert tral("reset", "4", "--name", NAME).exit_code == 0
    status = json.loads(tral("status", "--name", NAME).output)
    assert status["seed"] == 4
    assert list(status["faults"]) == ["sonar-silent"]
    assert tral("fault", "sonar-silent", "--off", "--name", NAME).exit_code == 0
    assert json.loads(tral("status", "--name", NAME).output)["faults"] == {}
    refused = tral("fault", "sonar-silence", "--name", NAME)
    assert refused.exit_code == BAD_USAGE


def test_the_list_of_faults_needs_no_twin() -> None:
    listed = tral("fault", "list")
    assert listed.exit_code == 0
    assert [line.split()[0] for line in listed.output.splitlines()] == list(INJECTED_FAULTS)


def test_without_a_twin_the_commands_say_so() -> None:
    refused = tral("status", "--name", "nobody")
    assert refused.exit_code == MACHINE_LACKS
    assert "tral twin up" in refused.output


def test_up_refuses_what_cannot_be() -> None:
    assert tral("up", "--scenario", "moon").exit_code == BAD_USAGE


def test_up_ends_by_itself() -> None:
    begun_s = time.monotonic()
    done = tral("up", "--name", f"{NAME}-short", "--scenario", "straight", "--bus", str(BUS + 20), "--seconds", "0.2")
    assert done.exit_code == 0, done.output
    assert time.monotonic() - begun_s < 60.0
