"""Pictures of machines: the places of all parts (`layout`), and their look (`picture`, `svg`, `png`)."""
