"""Without the extra `rl` training says what is missing, and policies drive."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
WITHOUT = "import sys; sys.modules['torch'] = sys.modules['stable_baselines3'] = None\n"


@pytest.mark.parametrize("algo", ["teacher", "ppo"])
def test_training_names_the_extra(algo: str) -> None:
    code = f"{WITHOUT}from tral_fsm.cli import app; app(['train', '--algo', {algo!r}, '--steps', '5'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 3, done.stderr
    told = " ".join(done.stderr.split())
    assert "tral train needs the package 'torch', which is not installed" in told
    assert re.search(r"pip install (-e )?'\.\[rl\]' \(without a graphics card, first the CPU build of torch", told)


def test_a_trained_policy_drives_without_torch() -> None:
    code = f"""
sys.path[:0] = [{str(TESTS / "core")!r}, {str(TESTS)!r}]
from test_learned import network, nothing_seen
from tral_env import policy_file
from tral_fsm import load_policy
import tempfile
with tempfile.TemporaryDirectory() as folder:
    policy_file.save(network(), folder)
    assert load_policy(folder).act(nothing_seen()[0]).shape == (2,)
"""
    done = subprocess.run([sys.executable, "-c", WITHOUT + code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
