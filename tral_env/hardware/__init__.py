"""The real car behind the spaces of the simulated one."""
