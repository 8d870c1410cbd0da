"""A drive tick by tick: the table, its file, and what stands in it when the run is killed."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from readings import Bench, two_states
from typer.testing import CliRunner

from tral_env.interface import CONTROL_PERIOD_S, CORE_LAYOUT
from tral_fsm import MachinePolicy, load_policy
from tral_fsm.cli import app
from tral_fsm.evaluation.episode import Tick
from tral_fsm.formats.tral_json import loads
from tral_fsm.report.drive.trace import COLUMNS, TraceFile, row
from tral_fsm.runtime.machine import Transit

NEAR = {"type": "SensorLevel", "sensor": "front", "below": 0.5}
OPEN = {"type": "SensorLevel", "sensor": "left", "above": 1.5}


def tick(index: int = 0, **changes: object) -> Tick:
    values = {"ultrasonic_left": 1.25, "ultrasonic_front": 2.5, "ultrasonic_right": 0.5, "distance": 3.0, "speed": 0.7}
    given = {
        "index": index,
        "observation": CORE_LAYOUT.pack(values, 1)[0],
        "state": "follow",
        "action": np.array([0.25, 0.5], np.float32),
        "info": {"time_s": CONTROL_PERIOD_S * (index + 1), "pose": np.array([1.0, -2.0, 0.5]), "speed_mps": 0.75},
        **changes,
    }
    return Tick(**given)  # type: ignore[arg-type]


class TestRow:
    def test_a_tick_has_its_readings_output_and_state(self) -> None:
        got = dict(zip(COLUMNS, row(tick(wanted=(-1.0, 0.8))), strict=True))
        assert got == {
            "tick": "0", "time_s": "0.0125", "state": "follow", "transition": "", "to": "", "why": "",
            "left_m": "1.2500", "front_m": "2.5000", "right_m": "0.5000", "distance_m": "3.0000",
            "speed_mps": "0.7000", "steering": "0.2500", "throttle": "0.5000",
            "wanted_side": "right", "wanted_clearance_m": "0.8000",
            "gate_id": "", "gate_x_m": "", "gate_y_m": "", "gate_heading_rad": "", "gate_age_s": "",
            "marker_id": "", "marker_x_m": "", "marker_y_m": "", "marker_heading_rad": "", "marker_age_s": "",
            "true_x_m": "1.0000", "true_y_m": "-2.0000", "true_yaw_rad": "0.5000", "true_speed_mps": "0.7500",
        }  # fmt: skip

    @pytest.mark.parametrize("what", ["gate", "marker"])
    def test_a_gate_and_a_marker_have_their_id_place_and_age(self, what: str) -> None:
        seen = dict(zip(("id", "x", "y", "heading", "age"), (12.0, 1.5, -0.25, 0.125, 0.5), strict=True))
        observation = CORE_LAYOUT.pack({f"{what}_{name}": value for name, value in seen.items()}, 1)[0]
        got = dict(zip(COLUMNS, row(tick(observation=observation)), strict=True))
        assert {name: value for name, value in got.items() if name.startswith(what)} == {
            f"{what}_id": "12", f"{what}_x_m": "1.5000", f"{what}_y_m": "-0.2500",
            f"{what}_heading_rad": "0.1250", f"{what}_age_s": "0.5000",
        }  # fmt: skip
        other = {"gate": "marker", "marker": "gate"}[what]
        assert {value for name, value in got.items() if name.startswith(other)} == {""}

    def test_transitions_of_inner_machines_stand_before_those_of_outer_ones(self) -> None:
        inner = Transit(0.1, ("x",), 1, 2, "in", "a 1 > 0")
        outer = Transit(0.1, (), "x", "y", "out", "FSMState is finished")
        got = dict(zip(COLUMNS, row(tick(transits=(inner, outer))), strict=True))
        assert (got["transition"], got["to"], got["why"]) == ("in | out", "2 | y", "a 1 > 0 | FSMState is finished")


class TestFile:
    def test_what_has_happened_stands_in_the_file_before_it_is_closed(self, tmp_path: Path) -> None:
        path = tmp_path / "trace.csv"
        with TraceFile(path) as write:
            write(tick(0))
            write(tick(1))
            rows = list(csv.reader(path.read_text("utf-8").splitlines()))
        assert [cells[0] for cells in rows] == ["tick", "0", "1"]
        assert all(len(cells) == len(COLUMNS) for cells in rows)

    def test_drive_writes_it_when_asked(self, tmp_path: Path) -> None:
        arguments = ["drive", "--scenario", "straight", "--camera", "projected", "--no-video", "--policy", "wall"]
        result = CliRunner().invoke(app, [*arguments, "--trace", "--json", "--out", str(tmp_path)])
        report = json.loads(result.stdout)
        rows = list(csv.DictReader((tmp_path / "trace.csv").read_text("utf-8").splitlines()))
        assert len(rows) == round(report["episodes"][0]["time_s"] / CONTROL_PERIOD_S)
        assert {r["state"] for r in rows} == {"follow"}
        assert "trace.csv" in report["episodes"][0]["files"]
        again = CliRunner().invoke(app, [*arguments, "--json", "--out", str(tmp_path)])
        assert again.exit_code == result.exit_code
        assert not (tmp_path / "trace.csv").exists()


class TestReasons:
    @pytest.mark.parametrize(
        ("condition", "readings", "why"),
        [
            ({"type": "Any", "of": [NEAR, OPEN]}, {"front": 3.0, "left": 2.0}, "Any(left 2.000 > 1.5 m)"),
            (
                {"type": "Any", "of": [{"type": "Always"}, OPEN]},
                {"left": 1.0},
                "Any(Always)",
            ),
            (
                {"type": "All", "of": [NEAR, OPEN]},
                {"front": 0.4, "left": 2.0},
                "All(front 0.400 < 0.5 m; left 2.000 > 1.5 m)",
            ),
            ({"type": "Not", "of": [NEAR]}, {"front": 3.0}, "Not(front 3.000 < 0.5 m)"),
            ({"type": "Timer", "seconds": 0.01}, {}, None),
        ],
    )
    def test_combined_conditions_tell_what_holds(
        self, condition: dict[str, object], readings: dict[str, float], why: str | None
    ) -> None:
        bench = two_states(condition)
        bench.tick(**readings)
        assert [t.why for t in bench.fired] == ([why] if why else [])

    def test_finished_tells_who(self) -> None:
        bench = two_states({"type": "Finished"}, {"type": "Motor", "throttle": 0.1, "distance": 0.5})
        bench.tick(distance=0.0)
        bench.tick(distance=0.5)
        assert bench.fired[0].why == "Motor is finished"

    def test_what_counts_is_asked_in_every_tick_though_another_part_has_settled_the_matter(self) -> None:
        twice = {"type": "SensorLevel", "sensor": "front", "below": 0.5, "readings": 2}
        bench = two_states({"type": "All", "of": [{"type": "Distance", "distance": 1.0}, twice]})
        bench.tick(front=0.4)
        bench.tick(front=0.4)
        bench.tick(distance=1.0)
        assert bench.active == "b"


class TestPolicy:
    def test_a_trace_can_be_asked_for_later_and_given_up(self) -> None:
        machine = {
            "root": 0,
            "states": [{"id": k, "type": "Motor", "throttle": 0.1} for k in (0, 1)],
            "transitions": [
                {"id": k, "type": "Timer", "seconds": CONTROL_PERIOD_S, "from": k, "to": 1 - k} for k in (0, 1)
            ],
        }
        policy = MachinePolicy(loads(json.dumps(machine)))
        fired: list[Transit] = []
        observation = CORE_LAYOUT.pack({}, 1)
        for trace in (None, fired.append, None):
            policy.trace = trace
            for _ in range(4):
                policy.act(observation)
        assert [t.source for t in fired] == [1, 0, 1, 0]

    def test_machines_inside_are_heard_too(self) -> None:
        inner = {"root": 0, "states": [{"id": 0, "type": "Motor", "throttle": 0.1}, {"id": 1, "type": "Stop"}],
                 "transitions": [{"id": "in", "type": "Always", "from": 0, "to": 1}]}  # fmt: skip
        bench = Bench({"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": inner, "final": True}]})
        fired: list[Transit] = []
        bench.machine.watch(fired.append)
        bench.tick()
        assert [(t.path, t.transition) for t in fired] == [((0,), "in")]
        assert bench.fired == []


def test_the_picture_numbers_the_transitions_of_the_outermost_machine() -> None:
    import gymnasium as gym

    from tral_fsm.evaluation.rollout import drive
    from tral_fsm.report.drive.trajectory import outer_transits

    env = gym.make("tral_env:TralCorridor-v0", scenario="corners", randomization="none", max_episode_steps=900)
    episode = drive(env, load_policy("corridor"), 3)
    numbered = outer_transits(episode.trace)
    assert [number for number, _, _ in numbered] == list(range(1, len(numbered) + 1))
    assert numbered[0][2] in ("left is open", "right is open")
    env.close()
