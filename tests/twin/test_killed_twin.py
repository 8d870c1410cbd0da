"""A twin that was killed takes its boards with it: the actuator's process gives them up, and nothing is left."""

import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from tral_env.errors import HardwareError
from tral_env.hardware.actuator.client import ActuatorProcess
from tral_env.hardware.actuator.laws import Channel
from tral_env.hardware.actuator.settings import Limits, Settings
from tral_env.twin.running import TwinProcess
from tral_env.twin.settings import TwinSettings

sys.path.append(str(Path(__file__).parents[1] / "hardware" / "actuator"))
from faults import is_gone, wait_until

STEERING = Channel(0, 1810.0, 1530.0, 1240.0, 0.0, 1240.0, 1810.0, 0.0)
THROTTLE = Channel(1, 1900.0, 1500.0, 1100.0, 0.0, 1100.0, 1900.0, 40.0)
PATIENCE_S = 120.0
"""Of the waits, for a busy computer."""


def settings_of(status: dict[str, Any], board: str) -> Settings:
    """Settings for a board of a twin."""
    if board == "pca9685":
        driver, device, options = "pca9685", status["i2c"], None
    elif board == "sysfs-pwm":
        folder = Path(status["i2c"]).parent / "pwm"
        driver, device, options = "sysfs-pwm", str(folder / "pwmchip0"), {"root": str(folder)}
    else:
        driver, device = board, status["serial"][board]
        options = {"port": device}
    return Settings(
        driver=driver, bus=device, options=options, period_us=17430, oscillator_hz=25e6, steering=STEERING,
        throttle=THROTTLE, limits=Limits(arming_s=0.05, evidence_s=None), in_container=True,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("board", ["pca9685", "sysfs-pwm", "board2016", "ucboard"])
def test_worker_and_keeper_end_when_the_twin_was_killed(board: str, tmp_path: Path, device_files: None) -> None:
    folder = tmp_path / "twin"
    twin = TwinProcess(TwinSettings(scenario="straight", seed=3, bus=None, folder=str(folder), board=board))
    actuator = ActuatorProcess(settings_of(twin.first_status, board))
    pids = actuator.hello["worker"], actuator.hello["keeper"]
    os.kill(twin.pid, signal.SIGKILL)
    twin.close()
    killed_s = time.monotonic()
    with pytest.raises(HardwareError, match="could not end the pulses yet"):
        actuator.close()
    wait_until(lambda: all(map(is_gone, pids)), PATIENCE_S)
    assert time.monotonic() - killed_s > 10.0, "a stand-in may come back"
    actuator.close()
