"""Processes of the twin: ``python -m tral_env.twin SETTINGS`` is that of `running`, ``camera`` that of `camera`."""

import sys

from tral_env.twin import camera, running

if __name__ == "__main__":
    sys.exit(camera.main() if sys.argv[1:] == [camera.CAMERA] else running.main(sys.argv[1:]))
