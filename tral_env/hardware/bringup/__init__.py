"""From the parts to a car that drives: a car file, the guided calibration, the check before a drive."""
