"""Calibration of a camera's lens: boards, views of them, the fit, its verdict, and the pages to print."""
