"""Measurements of speed, for `tral bench` and the scripts of benchmarks/."""
