"""Calibration of a camera's lens."""
