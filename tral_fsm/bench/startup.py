"""Cost of a start, measured in new interpreters: time to import and to make an environment, memory of a row."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys

_BEGIN = """
import json, sys, time
start = time.perf_counter()
import tral_env
imported = time.perf_counter()
import gymnasium as gym
env = gym.make("TralCorridor-v0", scenario=sys.argv[1])
env.reset(seed=0)
print(json.dumps({"import_s": imported - start, "make_and_reset_s": time.perf_counter() - imported}))
"""
_MEMORY = """
import json, sys
import numpy as np
from tral_env.vector_env import TralCorridorVectorEnv
rows = int(sys.argv[2])
env = TralCorridorVectorEnv(rows, scenario=sys.argv[1])
env.reset(seed=0)
env.step(np.zeros((rows, 2)))
try:
    with open("/proc/self/status") as status:
        kilobytes = next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))
except OSError:  # elsewhere than on Linux, where the peak would be that of the process that started this one
    import resource
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024 if sys.platform == "darwin" else 1)
print(json.dumps({"mb": kilobytes / 1024}))
"""
_ROWS, _MORE_ROWS = 16, 272
"""Numbers of rows of the two environments whose memory is compared."""
_STARTS = 3
"""Number of interpreters that start one after the other; the first one also warms the cache of files."""


def startup_cost(scenario: str) -> dict[str, float]:
    """Measure the cost of a start.

    Returns:
        ``import_s`` of tral_env; ``make_and_reset_s`` of `gym.make` and the first reset with their imports, both the
        median of some starts; ``memory_mb_per_row`` of the native vector environment.
    """
    few, many = (_run(_MEMORY, scenario, str(rows))["mb"] for rows in (_ROWS, _MORE_ROWS))
    starts = [_run(_BEGIN, scenario) for _ in range(_STARTS)]
    medians = {name: statistics.median(start[name] for start in starts) for name in starts[0]}
    return {**medians, "memory_mb_per_row": (many - few) / (_MORE_ROWS - _ROWS)}


def _run(script: str, *arguments: str) -> dict[str, float]:
    done = subprocess.run([sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=True)
    figures: dict[str, float] = json.loads(done.stdout)
    return figures
