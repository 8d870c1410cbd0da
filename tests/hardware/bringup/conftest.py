"""The tests of this folder use the rig of the actuator: a guard, a worker and a board that fails on demand."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "actuator"))
