"""`tral deploy` and `tral teleop` in a terminal of their own."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from bench_car import car_file
from typer.testing import CliRunner

from tral_fsm.cli import app

BLIND = "class Blind:\n    def act(self, observation):\n        return [0.0, 0.2]\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    car_file(tmp_path)
    (tmp_path / "blind.py").write_text(BLIND)
    return tmp_path


class Typing:
    """A command in a terminal at which a test types."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self._person, program = pty.openpty()
        code = "import sys; from tral_fsm.cli import app; app()"
        self.process = subprocess.Popen(
            [sys.executable, "-c", code, *arguments], stdin=program, stdout=program, stderr=program, cwd=folder,
            start_new_session=True,
        )  # fmt: skip
        os.close(program)
        self.text = ""

    def wait_for(self, text: str, seconds: float = 60.0) -> None:
        until = time.monotonic() + seconds
        while text not in self.text:
            assert time.monotonic() < until, self.text
            try:
                self.text += os.read(self._person, 65536).decode()
            except OSError:  # the program has ended
                assert text in self.text, self.text

    def type(self, keys: str) -> None:
        os.write(self._person, keys.encode())

    def hang_up(self) -> None:
        os.close(self._person)
        self.process.wait(30)

    def status(self) -> int:
        try:
            while read := os.read(self._person, 65536):
                self.text += read.decode()
        except OSError:
            pass
        status = self.process.wait(30)
        os.close(self._person)
        return status


def deploy(folder: Path, *more: str) -> Typing:
    return Typing(folder, "deploy", "--policy", "blind.py:Blind", "--dry", "--out", "out", *more)


@pytest.mark.slow
@pytest.mark.parametrize(("keys", "why", "status"), [("q", "ended by the keyboard", 0), (" ", "emergency stop", 1)])
def test_a_key_arms_and_another_ends(folder: Path, keys: str, why: str, status: int) -> None:
    run = deploy(folder)
    run.wait_for("To arm, press r")
    run.type("r")
    run.wait_for("80 Hz")
    run.type(keys)
    assert run.status() == status
    assert why in run.text
    assert why in json.loads((folder / "out" / "summary.json").read_text())["ended_by"]


@pytest.mark.slow
def test_a_key_that_was_typed_before_the_prompt_does_not_arm(folder: Path) -> None:
    run = deploy(folder)
    run.type("r")
    run.wait_for("To arm, press r")
    time.sleep(0.5)
    run.type("q")
    assert run.status() == 0
    assert json.loads((folder / "out" / "summary.json").read_text())["figures"]["ticks"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_a_drive_with_its_summary(folder: Path, number: signal.Signals) -> None:
    run = deploy(folder)
    run.wait_for("To arm, press r")
    run.type("r")
    run.wait_for("Hz")
    run.process.send_signal(number)
    assert run.status() == 0
    assert json.loads((folder / "out" / "summary.json").read_text())["ended_by"] == number.name


@pytest.mark.slow
def test_a_terminal_that_is_lost_ends_the_drive_with_its_summary(folder: Path) -> None:
    run = deploy(folder)
    run.wait_for("To arm, press r")
    run.type("r")
    run.wait_for("Hz")
    run.hang_up()
    summary = json.loads((folder / "out" / "summary.json").read_text())
    assert summary["failed"]
    assert summary["ended_by"].startswith("the terminal is gone")


@pytest.mark.slow
def test_a_person_drives_a_simulated_car(folder: Path) -> None:
    run = Typing(folder, "teleop", "--scenario", "straight", "--seed", "3", "--out", "hand")
    run.wait_for("To arm, press r")
    run.type("r")
    run.wait_for("Hz")
    for _ in range(20):
        run.type("w")
        time.sleep(0.05)
    run.type("q")
    assert run.status() == 0
    summary = json.loads((folder / "hand" / "summary.json").read_text())
    assert summary["figures"]["states_s"]["by hand"] > 0.3
    assert summary["figures"]["distance_m"] > 0.05
    assert (folder / "hand" / "drive.mcap").stat().st_size > 1000


def test_without_a_terminal_it_refuses_to_arm(folder: Path) -> None:
    done = CliRunner().invoke(app, ["deploy", "--policy", f"{folder}/blind.py:Blind", "--config", f"{folder}/car.toml"])
    assert done.exit_code == 2
    assert "no terminal and no gamepad" in done.output


@pytest.mark.parametrize("arm", [[], ["--arm"]])
def test_without_a_terminal_a_dry_run_drives_at_once(folder: Path, arm: list[str]) -> None:
    done = CliRunner().invoke(
        app,
        ["deploy", "--policy", f"{folder}/blind.py:Blind", "--config", f"{folder}/car.toml", "--dry", *arm,
         "--seconds", "0.3", "--out", f"{folder}/out", "--json"],
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert report["ended_by"] == "time limit"
    assert report["arguments"]["arm"] is bool(arm)


@pytest.mark.parametrize("command", ["deploy --policy wall --arm --config", "car check", "car calibrate"])
def test_a_missing_car_file_is_told(command: str) -> None:
    done = CliRunner().invoke(app, [*command.split(), "none.toml"])
    assert done.exit_code == 2
    assert "none.toml" in done.output
    assert "`tral car init` writes a car file to begin with" in " ".join(done.output.split())


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--scenario", "straight", "--dry"], "--dry beside --scenario"),
        (["--config", "car.toml", "--seed", "7"], "--seed is for a simulated car"),
        (["--config", "car.toml", "--randomization", "default"], "--randomization is for a simulated car"),
    ],
)
def test_an_option_of_another_car_is_refused(options: list[str], told: str) -> None:
    done = CliRunner().invoke(app, ["teleop", *options])
    assert done.exit_code == 2
    assert told in " ".join(done.output.split())
