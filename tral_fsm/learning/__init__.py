"""Training: a network learns from a machine, or by itself (extra `rl`)."""
