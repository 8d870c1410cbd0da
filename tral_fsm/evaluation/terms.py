"""What is the same for all contenders of a comparison: limits, rates and delays of each level."""

from __future__ import annotations

from tral_env.config import CameraConfig, TaskConfig
from tral_env.interface import CONTROL_RATE_HZ
from tral_env.randomization import Range, level
from tral_fsm.evaluation.suites import Suite


def terms(suite: Suite) -> list[dict[str, object]]:
    """Rows for JSON: what it is, and its value on each level of the suite; all contenders have the same."""
    task, camera = TaskConfig(), CameraConfig()
    levels = [level(name) for name in suite.levels]
    rows = {
        "time limit of a course": [f"route / ({task.nominal_speed:g} m/s) + {task.grace_s:g} s"] * len(levels),
        "max_episode_steps": ["none: the time limit ends a drive"] * len(levels),
        "readings and commands": [f"{CONTROL_RATE_HZ:g} a second"] * len(levels),
        "images of the camera": [f"{camera.rate_hz:g} a second"] * len(levels),
        "from command to pulse": [_milliseconds(one.latency_s) for one in levels],
        "from exposure to detection": [_milliseconds(one.camera_latency_s) for one in levels],
        "from one range to the next": [_milliseconds(one.sonar_cadence_s) for one in levels],
    }
    return [{"term": name, "values": values} for name, values in rows.items()]


def _milliseconds(ends: Range) -> str:
    """A range of times; each car has its own, and it is the same car for all contenders."""
    low, high = (f"{1000.0 * end:g}" for end in ends)
    return f"{low} ms" if low == high else f"{low} to {high} ms"
