"""Every branch of what decides about pulses is taken by the tests beside this file that start no process."""

import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
DECIDES = (
    "laws",
    "wire",
    "settings",
    "options",
    "guard",
    "pca9685",
    "sysfs_pwm",
    "serial_boards",
    "worker",
    "keeper",
    "stand_in",
    "drivers",
    "client",
    "rights",
)
TESTS = (
    "actuator_laws",
    "wire",
    "actuator_settings",
    "guard",
    "board_registers",
    "boards_by_name",
    "sysfs_pwm",
    "serial_boards",
    "worker",
    "keeper",
    "stand_in",
    "actuator_client",
    "rights",
)


@pytest.mark.slow
def test_every_branch_of_what_decides_about_pulses_is_tested(tmp_path: Path) -> None:
    pytest.importorskip("coverage")
    files = ",".join(f"{ROOT}/tral_env/hardware/actuator/{name}.py" for name in DECIDES)
    tests = [str(HERE / f"test_{name}.py") for name in TESTS]
    data = f"--data-file={tmp_path / 'coverage'}"
    run = [sys.executable, "-m", "coverage", "run", data, "--branch", f"--include={files}"]
    pytest_options = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-o", "addopts="]
    subprocess.run([*run, *pytest_options, *tests], cwd=ROOT, check=True, capture_output=True)
    report = [sys.executable, "-m", "coverage", "report", data, "-m", "--fail-under=100", "--precision=2"]
    done = subprocess.run(report, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert done.stdout.count("100.00%") == len(DECIDES) + 1
