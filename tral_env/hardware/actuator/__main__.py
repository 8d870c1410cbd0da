"""Start of the actuator's process, by path: ``python -I .../actuator/__main__.py``.

The package `tral_env` registers environments at Gymnasium when it is imported. This process must not load that, so it
gets a bare package of the same name, which finds its modules and runs no ``__init__``.
"""

import sys
from pathlib import Path
from types import ModuleType

if "tral_env" not in sys.modules:
    _bare = ModuleType("tral_env")
    _bare.__path__ = [str(Path(__file__).resolve().parents[2])]
    sys.modules["tral_env"] = _bare

from tral_env.hardware.actuator.keeper import main, switch_off

if __name__ == "__main__":
    # The policy's process gives the number of a socket; a person gives words.
    sys.exit(main(sys.argv[1:]) if sys.argv[1:2] and sys.argv[1].isdecimal() else switch_off(sys.argv[1:]))
