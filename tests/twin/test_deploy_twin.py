"""The script that lets `tral deploy` drive the twin: the car file that it writes, and how it counts what was seen."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tral_env.calibration.camera_info import write_camera_info
from tral_env.config import CameraConfig
from tral_env.hardware.bringup.steps import missing_steps
from tral_env.hardware.car_file import parse_car
from tral_env.interface import CORE_LAYOUT, NOTHING_SEEN_ID

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import deploy_twin

STATUS: dict[str, Any] = {
    "i2c": "/run/tral-twin/t/dev/i2c-1",
    "hall": "/run/tral-twin/t/hall",
    "oscillator_hz": 26.3e6,
    "serial": {"board2016": "/run/tral-twin/t/tty-board2016", "ucboard": "/run/tral-twin/t/tty-ucboard"},
    "camera": "http://127.0.0.1:1234/stream.mjpg",
}


@pytest.mark.parametrize(
    ("board", "sensors"),
    [("pca9685", ["srf08", "twin-hall"]), ("board2016", ["board2016"]), ("ucboard", ["ucboard"])],
)
def test_its_car_is_calibrated_and_has_the_camera_of_the_twin(board: str, sensors: list[str], tmp_path: Path) -> None:
    write_camera_info(tmp_path / "lens.yaml", CameraConfig())
    car = parse_car(deploy_twin.car_file(STATUS, board), folder=tmp_path)
    assert (car.board.driver, [sensor.driver for sensor in car.sensors]) == (board, sensors)
    assert car.clock_is_known
    assert missing_steps(car) == ()
    assert car.camera is not None
    assert (car.camera.device, car.camera.calibrated().width) == (STATUS["camera"], 640)


def test_a_gate_is_seen_anew_when_its_age_falls() -> None:
    ages, ids = [5.0, 0.02, 0.0325, 0.02, 0.02, 0.0325], [NOTHING_SEEN_ID, 1, 1, 1, NOTHING_SEEN_ID, NOTHING_SEEN_ID]
    observations = np.zeros((6, len(CORE_LAYOUT.names)), np.float32)
    observations[:, CORE_LAYOUT.names.index("gate_age")] = ages
    observations[:, CORE_LAYOUT.names.index("gate_id")] = ids
    assert deploy_twin.sightings(observations, CORE_LAYOUT) == {"gates_seen": 2, "markers_seen": 0}
