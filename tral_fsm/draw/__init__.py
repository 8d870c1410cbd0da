"""Machines as pictures: where everything stands (`layout`), and what it looks like (`svg`, `png`)."""

from tral_fsm.draw.layout import Layout, layout

__all__ = ["Layout", "layout"]
