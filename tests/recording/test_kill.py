"""A process that records is killed: what it had handed over half a second before is in the file."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from recorded_drives import observations

from tral_env.recording.read import read

PROGRAM = """
import sys, time
from recorded_drives import observations
from tral_env.recording.recorder import Recorder

begin_s = time.monotonic()
with Recorder(sys.argv[1], start_s=begin_s) as recorder:
    for k, row in enumerate(observations(800)):
        recorder.tick(time_s=time.monotonic(), observation=row, action=(0.0, 0.0))
        print(k, time.monotonic(), flush=True)
        time.sleep(max(0.0, begin_s + k / 80 - time.monotonic()))
"""


@pytest.mark.parametrize("after_s", [0.1, 0.9])
def test_half_a_second_before_the_kill_all_is_in_the_file(tmp_path: Path, after_s: float):
    path = tmp_path / "drive.mcap"
    here = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    with subprocess.Popen([sys.executable, "-c", PROGRAM, path], stdout=subprocess.PIPE, text=True, env=here) as child:
        assert child.stdout is not None
        told = [child.stdout.readline()]
        time.sleep(after_s)  # the recorder of another process keeps its own time
        killed_s = time.monotonic()
        child.kill()
        told += child.stdout.readlines()
    handed = [float(line.split()[1]) for line in told if line.endswith("\n")]
    found = read(path)
    np.testing.assert_array_equal(found.observation, observations(800)[: len(found.tick)])
    assert len(found.tick) >= sum(stamp < killed_s - 0.5 for stamp in handed)
    assert found.damage or len(found.tick) == len(handed)
