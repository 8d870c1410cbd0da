"""The page about the real car tells the truth: its examples run, its table shows the packaged calibration."""

import re
from pathlib import Path

import pytest

from tral_env.hardware.calibration_file import load_calibration

PAGE = (Path(__file__).parents[2] / "docs" / "real_car.md").read_text()
EXAMPLES = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


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
    exec(compile(example("as refusal:"), "docs/real_car.md", "exec"), {})
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
