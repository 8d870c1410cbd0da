"""TralCar-v0(record=...): an episode leaves a file of what the policy was told, did, and what became of it."""

from pathlib import Path

import numpy as np
import pytest
from fakes import Clock, FakeSmbus, Srf08Fake

from tral_env.errors import HardwareError
from tral_env.hardware.env import TralCarEnv
from tral_env.hardware.sensors import HallCounter, SensorGroup
from tral_env.hardware.sonar import SonarArray
from tral_env.interface import CORE_LAYOUT
from tral_env.recording.read import read
from tral_fsm import load_policy

GO = np.array([0.5, 0.25], np.float32)


def car(path: Path, **options):
    clock = Clock()
    return TralCarEnv(clock=clock, sleep=clock.sleep, record=path, **options), clock


def test_a_tick_has_what_the_policy_was_told_and_what_became_of_its_answer(tmp_path: Path):
    env, _ = car(tmp_path / "drive.mcap")
    told, _ = env.reset()
    rows = [told]
    for _ in range(3):
        told, *_, info = env.step(GO)
        rows.append(told)
    env.close()
    found = read(tmp_path / "drive.mcap")
    np.testing.assert_array_equal(found.observation, rows[:3])
    np.testing.assert_array_equal(found.action, np.tile(GO, (3, 1)))
    steering = CORE_LAYOUT.column("steering")
    np.testing.assert_array_equal(found.applied[:2, 0].astype(np.float32), [rows[1][steering], rows[2][steering]])
    assert found.pulses_us[2].tolist() == [info["steering_us"], info["throttle_us"]]
    np.testing.assert_allclose(found.time_s, [0.0125, 0.025, 0.0375])


def test_a_file_tells_the_car_and_how_it_was_made(tmp_path: Path):
    env, _ = car(tmp_path / "drive.mcap", max_duration_s=5.0)
    env.reset()
    env.close()
    found = read(tmp_path / "drive.mcap")
    assert found.configuration == {
        "calibration": "tt01",
        "config": None,
        "output": None,
        "sensors": None,
        "max_duration_s": 5.0,
    } | {"calibration": env.calibration.name}
    assert b'"oscillator_hz"' in found.files["calibration.json"]


def test_each_episode_has_a_file_of_its_own(tmp_path: Path):
    env, _ = car(tmp_path / "drive.mcap")
    for steps in (1, 2):
        env.reset()
        for _ in range(steps):
            env.step(GO)
    env.close()
    assert [len(read(tmp_path / name).tick) for name in ("drive.mcap", "drive-2.mcap")] == [1, 2]


def test_a_late_step_is_recorded_with_its_lateness(tmp_path: Path):
    env, clock = car(tmp_path / "drive.mcap")
    env.reset()
    for _ in range(3):
        env.step(GO)
    clock.sleep(0.0325)
    env.step(GO)
    env.close()
    found = read(tmp_path / "drive.mcap")
    assert found.late_ticks.tolist() == [0, 0, 0, 1]
    assert found.lateness_s[3] == pytest.approx(0.02)


def test_states_and_transitions_of_the_policy_are_recorded(tmp_path: Path):
    policy = load_policy("wall")
    fired = []
    policy.trace = fired.append
    env, _ = car(tmp_path / "drive.mcap")
    env.watch(policy, {"wall.json": b"{}"})
    told, _ = env.reset()
    for _ in range(60):
        told, *_ = env.step(policy.act(told))
    env.close()
    found = read(tmp_path / "drive.mcap")
    assert set(found.states) == {found.states[0], policy.active_states[0]}
    assert "silent" in found.states[-1]
    assert [one[1:] for one in found.transitions] == [
        (one.time, one.path, one.source, one.target, one.transition, one.why) for one in fired
    ]
    assert found.files["wall.json"] == b"{}"


def test_what_came_from_the_sensors_is_recorded_before_anything_is_made_of_it(tmp_path: Path):
    clock = Clock()
    bus = FakeSmbus({address: Srf08Fake(clock, metres) for address, metres in ((0x70, 1.0), (0x71, 2.0), (0x72, 3.0))})
    hall = HallCounter(clock=clock)
    sensors = SensorGroup(SonarArray(bus, sleep=clock.sleep), hall)
    env = TralCarEnv(clock=clock, sleep=clock.sleep, record=tmp_path / "drive.mcap", sensors=sensors)
    env.reset()
    for _ in range(10):
        env.step(GO)
    hall.edge()
    env.close()
    frames = read(tmp_path / "drive.mcap").frames
    assert {frame.source for frame in frames} == {"ultrasonic_left", "ultrasonic_front", "ultrasonic_right", "hall"}
    assert frames[-1].data == b"\x01"


class Eye:
    """A camera that has taken an image of one colour at each reading."""

    def start(self) -> None:
        pass

    def watch_images(self, watcher) -> None:
        self.watcher = watcher

    def read(self, now: float):
        self.watcher(now - 0.05, np.full((48, 64, 3), 90, np.uint8))
        return {}

    def stop(self) -> None:
        pass


def test_images_of_a_camera_are_recorded_with_the_time_of_their_exposure(tmp_path: Path):
    env, _ = car(tmp_path / "drive.mcap", sensors=SensorGroup(Eye()))
    env.reset()
    for _ in range(3):
        env.step(GO)
    env.close()
    pictures = list(read(tmp_path / "drive.mcap").pictures())
    assert [picture.time_s for picture in pictures] == pytest.approx([-0.05, -0.0375, -0.025, -0.0125])
    assert pictures[0].pixels().shape == (48, 64, 3)


class Broken:
    """Sensors that fail at the second reading."""

    def __init__(self) -> None:
        self.left = 1

    def start(self) -> None:
        pass

    def read(self, now: float):
        self.left -= 1
        if self.left < 0:
            raise HardwareError("the wire is loose")
        return {}

    def stop(self) -> None:
        pass


def test_an_error_stands_in_the_recording(tmp_path: Path):
    env, _ = car(tmp_path / "drive.mcap", sensors=Broken())
    env.reset()
    with pytest.raises(HardwareError):
        env.step(GO)
    env.close()
    assert read(tmp_path / "drive.mcap").words[-1] == "HardwareError: the wire is loose"


def test_without_a_file_nothing_is_recorded(tmp_path: Path):
    env, _ = car(None)
    env.watch(load_policy("wall"))
    env.reset()
    env.step(GO)
    env.close()
    assert env.recording.current is None
    assert not list(tmp_path.iterdir())
