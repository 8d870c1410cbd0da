"""What all tests share."""

import signal
import subprocess
import sys

import pytest
from hypothesis import settings

# A busy machine is no failure. The rest stays as Hypothesis chose it: its own profile where the variable CI is set.
settings.register_profile("tral", settings(), deadline=None)
settings.load_profile("tral")

# A run in the background ignores Ctrl-C, and so would every program that a test starts and interrupts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Tell that the golden drives were skipped.

    It is no failure: their digests hold for one arithmetic, so a run on another processor would fail for its place and
    not for its code.
    """
    skipped = [each for each in terminalreporter.stats.get("skipped", []) if "rounds otherwise" in str(each.longrepr)]
    if skipped:
        terminalreporter.section("golden drives", yellow=True)
        terminalreporter.write_line(
            f"NOT compared: {len(skipped)} tests of tests/golden. Their digests were written where arithmetic rounds "
            "otherwise. To know whether a change keeps drives: before it `python tests/golden/drives.py --write`, "
            "after it `python tests/golden/drives.py`; do not commit that drives.json."
        )


_PROBE = """
import mujoco
from tral_env.perception.camera import SceneRenderer

model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><camera name='eye'/></worldbody></mujoco>")
with SceneRenderer() as renderer:
    renderer.render(model, mujoco.MjData(model), "eye", 8, 8)
"""


@pytest.fixture(scope="session")
def opengl() -> None:
    """What a test that renders asks for: it is skipped on a machine without OpenGL."""
    # In a process of its own: a context that could not be made may complain when it is thrown away, or crash.
    done = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"no OpenGL: {(done.stderr.splitlines() or ['the program crashed'])[-1]}")
