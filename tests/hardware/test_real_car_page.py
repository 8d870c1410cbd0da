"""The page about the real car tells the truth: its examples run, its table shows the packaged calibration."""

import os
import pty
import re
import subprocess
import sys
import tomllib
import tty
from pathlib import Path

import pytest

from tral_env.hardware.actuator.drivers import BOARDS
from tral_env.hardware.calibration_file import load_calibration
from tral_env.hardware.car_file import STEPS
from tral_env.hardware.sensor_drivers import SENSORS

PAGE = (Path(__file__).parents[2] / "docs" / "real_car.md").read_text()
EXAMPLES = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
TOML = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)


def example(part: str) -> str:
    """The only example that holds a text."""
    (found,) = [each for each in EXAMPLES if part in each]
    return found


@pytest.fixture
def fast(monkeypatch):
    """A clock that passes only by sleeping, so that the examples take no time."""
    from fakes import Clock

    from tral_env.hardware.env import TralCarEnv

    clock = Clock()
    monkeypatch.setitem(TralCarEnv.__init__.__kwdefaults__, "clock", clock)
    monkeypatch.setitem(TralCarEnv.__init__.__kwdefaults__, "sleep", clock.sleep)


@pytest.mark.usefixtures("fast")
def test_the_dry_run_does_what_it_says(capsys):
    exec(compile(EXAMPLES[0], "docs/real_car.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "40 ticks, 0 late"
    assert lines[1].endswith("steering_us=1385.0, throttle_us=1432.5)")
    assert lines[3].endswith("steering_us=1530.0, throttle_us=1530.0)")


def test_the_refusal_example_names_what_is_missing(capsys):
    exec(compile(example("without sensors"), "docs/real_car.md", "exec"), {})
    assert "the policy needs ultrasonic_right, distance, speed" in capsys.readouterr().out


def test_the_hall_example_counts_one_edge(capsys):
    exec(compile(example("hall = HallCounter()\nhall.edge()"), "docs/real_car.md", "exec"), {})
    assert capsys.readouterr().out == "0.02513\n"


def test_the_table_shows_the_packaged_calibration():
    car = load_calibration("tt01")
    rows = {
        "`period_us`": car.period_us,
        "`oscillator_hz`": int(car.oscillator_hz),
        "`right_us`, `neutral_us`, `left_us`": "1810, 1530, 1240",
        "`throttle.dead_zone_us`": car.throttle.dead_zone_us,
    }
    assert car.steering.knots[:3] == (1810, 1530, 1240)
    assert car.throttle.knots[:3] == (1860, 1530, 1140)
    for name, value in rows.items():
        assert f"{name} | {value} |" in PAGE


def test_the_car_file_example_tells_the_mistake_and_the_car(capsys):
    exec(compile(example("from tral_env.hardware.car_file import parse_car"), "docs/real_car.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "car.toml: 1 problem"
    assert lines[1] == "  car.toml:20: limits.hang_s: got 80 s: expected 0.03 to 0.5 s; is it in ms?"
    assert lines[2] == "pca9685 12 True"


@pytest.mark.parametrize(("header", "names"), [("### Boards", BOARDS), ("### Sensors", SENSORS)])
def test_the_tables_name_every_driver(header, names):
    table = PAGE.split(header, 1)[1].split("\n#", 1)[0]
    told = [name for row in re.findall(r"^\| (`.+?) \|", table, re.MULTILINE) for name in re.findall("`(.+?)`", row)]
    assert [name for name in told if name != "driver"] == list(names)


def test_the_steps_of_the_page_are_those_of_the_command():
    told = re.findall(r"^\| `(\w+)` \| ", PAGE.split("### 5.", 1)[1].split("### 6.", 1)[0], re.MULTILINE)
    assert ("clock", *told) == STEPS


def test_a_board_of_ones_own_drives_the_car_by_twenty_lines(tmp_path):
    """As a distribution of its own: a module and its entry point, in a folder that only this user has."""
    module = example("class LineBoard:")
    assert len([line for line in module.splitlines() if line.strip()]) <= 30
    (tmp_path / "line_board.py").write_text(module)
    (tmp_path / "line_board-0.1.dist-info").mkdir()
    project = tomllib.loads(next(block for block in TOML if "line-board" in block))["project"]
    for group, entries in project["entry-points"].items():
        lines = "".join(f"{name} = {value}\n" for name, value in entries.items())
        (tmp_path / "line_board-0.1.dist-info" / "entry_points.txt").write_text(f"[{group}]\n{lines}")
    (tmp_path / "line_board-0.1.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: line-board\n")
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    port = os.ttyname(theirs)
    program = f"""
import gymnasium, numpy
from tral_env.hardware.car_file import parse_car
TEXT = '''
version = 1
name = "mine"
board = {{driver = "line-board", port = "{port}"}}
pulses = {{file = "tt01"}}
limits = {{arming_s = 0.1, max_throttle = 0.5}}
'''
env = gymnasium.make("tral_env:TralCar-v0", config=parse_car(TEXT))
env.reset()
for _ in range(5):
    env.step(numpy.array([1.0, 1.0], numpy.float32))
env.close()
"""
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", str(Path(__file__).parents[2]))])
    subprocess.run([sys.executable, "-c", program], env=os.environ | {"PYTHONPATH": path}, check=True, timeout=60)
    os.set_blocking(ours, False)
    sent = os.read(ours, 65536).decode().split("\n")
    os.close(ours)
    os.close(theirs)
    assert sent[0] == "1530 1530"
    assert "1240 1335" in sent, "full left, and half of full forward, which is the limit"
    assert sent[-2] == "off"
