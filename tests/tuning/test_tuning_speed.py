"""The measurement of drives a minute: what it counts, not how fast this computer is."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from courses import blind

from tral_env.errors import ConfigError
from tral_fsm.formats import write

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import tuning_speed
from tuning_speed import Share


def test_figures_are_from_the_first_that_began_to_the_last_that_ended() -> None:
    shares = [
        Share(drives=30, simulated_s=300.0, began=100.0, ended=150.0, step_s=40.0, cpu_s=50.0),
        Share(drives=30, simulated_s=300.0, began=100.0, ended=160.0, step_s=37.0, cpu_s=49.0),
    ]
    got = tuning_speed.figures(shares)
    assert (got["seconds"], got["drives_per_minute"], got["simulated_s_per_drive"]) == (60.0, 60.0, 10.0)
    assert got["drives_of_20_s_per_minute"] == 30.0
    assert got["minutes_for_5000_drives_of_20_s"] == pytest.approx(5000 / 30)
    assert got["share_in_batch_step"] == pytest.approx(0.7)
    assert got["share_of_a_core"] == pytest.approx(0.9)


def test_the_time_in_steps_is_a_part_of_the_whole_and_every_drive_is_counted(tmp_path: Path) -> None:
    machine = tmp_path / "crashing.json"
    machine.write_text(write(blind(0.5, 1.0), "json"))
    got = tuning_speed.measure(str(machine), "straight", drives=5, rows=4)
    assert got.drives == 5
    assert 0.0 < got.step_s < got.ended - got.began
    assert 5 * 0.3 < got.simulated_s < 5 * 10.0


@pytest.mark.slow
def test_two_processes_leave_one_file(tmp_path: Path) -> None:
    machine, out = tmp_path / "crashing.json", tmp_path / "speed.json"
    machine.write_text(write(blind(0.5, 1.0), "json"))
    tuning_speed.main(policies=f"{machine}:straight", drives=2, processes=2, rows=2, out=out)
    (got,) = json.loads(out.read_text())["results"]
    assert (got["drives"], got["scenario"], len(got["processes"])) == (4, "straight", 2)


def test_a_machine_without_its_family_is_refused() -> None:
    with pytest.raises(ConfigError, match="--policies wall: expected MACHINE:FAMILY"):
        tuning_speed.main(policies="wall", drives=1, processes=1, rows=1)
