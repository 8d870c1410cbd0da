"""Drives to and from MCAP files: written beside the control loop, read back even where the file has no end."""
