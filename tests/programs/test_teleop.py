"""A person drives a car without devices, and a simulated one; both leave a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from on_the_car import Clock, Person, Words, car_file, parts

from tral_env.errors import ConfigError
from tral_env.recording.read import read
from tral_fsm.evaluation.recording import episode_of
from tral_fsm.programs.seat import Course
from tral_fsm.programs.teleop import TeleopArguments, run
from tral_fsm.teleop.hands import Hands

STRAIGHT = Course(scenario="straight", seed=3, randomization="none")


def drives(now: float) -> Hands:
    """Half a second at rest, then forward, and a little to the left."""
    return Hands(0.3, 0.0 if now < 0.5 else 0.8, holds=True, end=now > 2.0)


def by_hand(folder: Path, person: Person, **arguments: Any) -> dict[str, Any]:
    options = parts() if "config" in arguments else {}
    if not options:
        clock = Clock()
        options = {"clock": clock, "sleep": clock.sleep}
    return run(TeleopArguments(**arguments), folder / "out", [person], Words(), **options)


def test_a_person_drives_the_car_and_the_drive_is_data(tmp_path: Path) -> None:
    report = by_hand(tmp_path, Person(drives), config=car_file(tmp_path), dry=True)
    assert (report["ended_by"], report["failed"]) == ("ended by the keyboard", False)
    found = read(tmp_path / "out" / "drive.mcap")
    assert found.action[0].tolist() == pytest.approx([0.1387, 0.0], abs=1e-3)
    assert found.action[-1].tolist() == pytest.approx([0.1387, 0.35 * 0.7 / 0.9], abs=1e-3)
    assert set(found.states) == {"by hand"}


def test_a_person_drives_a_simulated_car_in_real_time(tmp_path: Path) -> None:
    report = by_hand(tmp_path, Person(drives), course=STRAIGHT)
    figures = report["figures"]
    assert figures["time_s"] == pytest.approx(2.0, abs=0.03)
    assert figures["distance_m"] > 0.3
    episode = episode_of(read(tmp_path / "out" / "drive.mcap"))
    assert (episode.seed, episode.scenario) == (3, "straight")
    assert len(episode.trace.action) == figures["ticks"]


def test_what_a_person_does_is_what_the_simulated_car_is_told(tmp_path: Path) -> None:
    by_hand(tmp_path, Person(lambda now: drives(now)._replace(holds=now < 1.0)), course=STRAIGHT)
    found = read(tmp_path / "out" / "drive.mcap")
    driven = np.flatnonzero(found.action[:, 1])
    assert driven[0] == pytest.approx(40, abs=2)
    assert driven[-1] == pytest.approx(80, abs=2)
    assert found.states[-1] == "let go"


def test_a_simulated_drive_that_ends_says_how(tmp_path: Path) -> None:
    wall = Person(lambda now: Hands(1.0, 0.0 if now < 0.1 else 1.0, holds=True))
    report = by_hand(tmp_path, wall, course=STRAIGHT, record=False)
    assert report["ended_by"] == "a touch"
    assert report["recording"] == ""


@pytest.mark.parametrize("which", [{}, {"config": "car.toml", "course": STRAIGHT}])
def test_it_is_one_car(which: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="either a car file"):
        TeleopArguments(**which)


def test_nobody_drives_without_a_device(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no terminal and no gamepad"):
        run(TeleopArguments(course=STRAIGHT), tmp_path / "out", [], Words())
