"""The process of `tral_env.twin.running.TwinProcess`: ``python -m tral_env.twin SETTINGS``."""

import sys

from tral_env.twin.running import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
