"""Machines as pictures: where everything stands (`layout`), and what it looks like (`picture`, `svg`, `png`)."""
