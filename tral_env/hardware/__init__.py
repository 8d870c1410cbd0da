"""The real car behind the spaces of the simulated one: its outputs, its sensors, its calibration."""
