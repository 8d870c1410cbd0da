"""How long the nodes wait for each other before the car stops; no message types, so that a command line can be read."""

COMMAND_TIMEOUT_S = 0.15
"""A command may be so old, since its stamp and since it came, s."""
CAMERA_TIMEOUT_S = 0.3
"""The camera may be silent for so long, s; when its process is dead, less."""
