"""The process that owns the servo and the motor controller: the standard library and the bus's library alone.

`client` speaks to it from the policy's process; all other modules run inside it, so none of them imports NumPy.
"""
