"""The guided calibration as a whole: broken off and resumed, kept after each step, told what is missing."""

from __future__ import annotations

import re
import subprocess
import sys
from datetime import date
from pathlib import Path

import pytest
from workbench import FILE, Script, Workbench, car_file

from tral_env.errors import BadFileError, ConfigError, MissingExtraError
from tral_env.hardware.bringup.car_text import CarText
from tral_env.hardware.bringup.guide import calibrate
from tral_env.hardware.bringup.steps import missing_steps, needed_steps
from tral_env.hardware.bringup.template import car_text
from tral_env.hardware.car_file import load_car, parse_car

MOVES = ("neutral", "ends", "direction", "dead_zone", "arming")
ALL = "".join(f"{step} = 2026-05-01\n" for step in ("clock", *MOVES))


@pytest.mark.parametrize(
    ("text", "steps"),
    [
        (FILE, ("clock", *MOVES)),
        (FILE + '[[sensors]]\ndriver = "hall"\n[camera]\n', ("clock", *MOVES, "hall", "camera")),
        (car_text(board="ucboard"), ("direction", "arming", "hall", "sonars", "camera")),
        (car_text(board="sysfs-pwm", sensors=("srf02",), camera=False), (*MOVES, "sonars")),
        (car_text(board="log", camera=False), MOVES),
    ],
)
def test_a_car_needs_the_steps_of_what_it_has(text: str, steps: tuple[str, ...]) -> None:
    assert needed_steps(parse_car(text)) == steps


def test_the_clock_counts_by_what_the_board_says() -> None:
    assert missing_steps(parse_car(FILE + f"[calibrated]\n{ALL}")) == ()
    unmeasured = FILE.replace("true", "false") + f"[calibrated]\n{ALL.removeprefix('clock = 2026-05-01')}"
    assert missing_steps(parse_car(unmeasured)) == ("clock",)


def test_a_calibration_that_is_broken_off_goes_on_where_it_stood(tmp_path: Path) -> None:
    path, bench = car_file(tmp_path), Workbench()
    first = Script(["", "", "q"])
    assert calibrate(path, first.person, bench.bench) == ("ends", "direction", "dead_zone", "arming")
    assert "broken off; the same command goes on here" in first.told
    assert load_car(path).calibrated == {"neutral": date.today()}
    second = Script(["", "", "", "", "y", "y", "y", "", "y"])
    assert calibrate(path, second.person, bench.bench) == ()
    assert second.said[0].startswith("Steps to do: ends, direction, dead_zone, arming.")
    assert second.said[-1] == f"All steps are done. Next: tral car check {path}"
    third = Script([])
    assert calibrate(path, third.person, bench.bench) == ()
    assert third.asked == []
    assert bench.rests


@pytest.mark.parametrize("end", ["quit", KeyboardInterrupt, EOFError])
def test_q_ctrl_c_and_a_lost_terminal_leave_the_car_at_rest(tmp_path: Path, end: object) -> None:
    def ended() -> str:
        if isinstance(end, str):
            return end
        raise end  # type: ignore[misc]

    path, bench = car_file(tmp_path), Workbench()
    before = path.read_text()
    assert "neutral" in calibrate(path, Script(["+", ended]).person, bench.bench)
    assert bench.rests
    assert path.read_text() == before, "a step that was not finished writes nothing"


def test_a_step_may_be_done_again_and_the_comments_stay(tmp_path: Path) -> None:
    path, bench = car_file(tmp_path, FILE + f"[calibrated]\n{ALL}"), Workbench()
    calibrate(path, Script(["", "", "n", "", "y"]).person, bench.bench, ["arming", "dead_zone"])
    text = path.read_text()
    assert 'name = "mine"  # a comment that stays' in text
    assert "# the clock" in text
    assert f"arming = {date.today()}" in text
    assert "arming_s = 1.5" in text


@pytest.mark.parametrize(
    ("steps", "told"),
    [
        (["hal"], "unknown step 'hal': did you mean 'hall'"),
        (["hall"], "step 'hall': this car does not need it. It needs: clock, neutral"),
    ],
)
def test_steps_that_there_are_not_are_refused(tmp_path: Path, steps: list[str], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        calibrate(car_file(tmp_path), Script([]).person, Workbench().bench, steps)


def test_a_value_of_none_takes_its_key_away(tmp_path: Path) -> None:
    text = CarText(car_file(tmp_path, FILE + "[limits]\nbrake = -0.5\n"))
    text.put({("limits", "brake"): None, ("limits", "hang_s"): None})
    assert load_car(text.path).limits.brake == 0.0


def test_a_value_that_makes_no_car_is_not_written(tmp_path: Path) -> None:
    text = CarText(car_file(tmp_path))
    before = text.path.read_text()
    with pytest.raises(BadFileError, match="trim_us"):
        text.put({("pulses", "steering", "trim_us"): 5000})
    assert text.path.read_text() == before


def test_a_file_that_cannot_be_written_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = CarText(car_file(tmp_path))

    def full(path: Path, content: bytes) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tral_env.hardware.bringup.car_text.write_bytes", full)
    with pytest.raises(ConfigError, match=r"cannot write .* No space left"):
        text.put({("limits", "brake"): 0.0})


def test_what_somebody_wrote_into_the_file_meanwhile_stays(tmp_path: Path) -> None:
    path, bench = car_file(tmp_path), Workbench()

    def edits() -> str:
        path.write_text(path.read_text().replace('"mine"', '"renamed"') + "[limits]\nmax_throttle = 0.2  # mine\n")
        return "y"

    calibrate(path, Script(["", edits]).person, bench.bench, ["arming"])
    car = load_car(path)
    assert (car.name, car.limits.max_throttle, car.limits.arming_s) == ("renamed", 0.2, 1.0)
    assert "# mine" in path.read_text()


def test_the_next_step_knows_what_somebody_wrote_into_the_file_meanwhile(tmp_path: Path) -> None:
    path, bench = car_file(tmp_path), Workbench()

    def edits() -> str:
        path.write_text(path.read_text() + "[pulses.steering]\nleft_us = 1300\n")
        return "y"

    calibrate(path, Script(["", edits, "y", "y"]).person, bench.bench, ["arming", "direction"])
    assert {steering for steering, _ in bench.pulses} == {0.0, 1530.0, 1300.0}


def test_a_file_that_was_spoilt_meanwhile_is_told_and_not_replaced(tmp_path: Path) -> None:
    text = CarText(car_file(tmp_path))
    text.path.write_text("name = ")
    with pytest.raises(BadFileError, match="not TOML"):
        text.put({("limits", "brake"): 0.0})
    assert text.path.read_text() == "name = "


def test_a_file_that_is_not_there_is_told_with_what_writes_one(tmp_path: Path) -> None:
    with pytest.raises(BadFileError, match="`tral car init` writes a car file to begin with"):
        CarText(tmp_path / "car.toml")


def test_tomlkit_that_is_missing_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tomlkit", None)
    with pytest.raises(MissingExtraError, match="tomlkit"):
        CarText(car_file(tmp_path))


@pytest.mark.slow
def test_the_command_drives_the_actuators_process_over_a_pipe(tmp_path: Path) -> None:
    """As over ssh, with the board "log", whose file has every pulse with its time."""
    log = tmp_path / "pulses.log"
    log.touch()
    path = tmp_path / "car.toml"
    text = car_text(board="log", camera=False).replace('bus = "pulses.log"', f'bus = "{log}"')
    path.write_text(text.replace("# arming_s = 1.0 ", "arming_s = 0.1 "))
    program = "import sys; from tral_fsm.cli import app; app()"
    run = subprocess.run(
        [sys.executable, "-c", program, "car", "calibrate", str(path), "--step", "direction"],
        input="y\n0\ny\n", capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert "Still missing: neutral, ends, dead_zone, arming" in run.stdout, run.stderr
    assert run.returncode == 1, "steps are missing"
    pulses = [tuple(map(float, line.split()[1:])) for line in log.read_text().splitlines()]
    assert pulses[0] == (1530.0, 1530.0)
    assert pulses[-1] == (0.0, 0.0)
    assert {throttle for _, throttle in pulses} == {0.0, 1530.0, 1491.0, 1471.5}
    assert {steering for steering, _ in pulses} == {0.0, 1530.0, 1240.0}
    assert re.search(r"direction = \d{4}-\d\d-\d\d", path.read_text())
