"""The engine: a machine at work, and a machine as a policy."""
