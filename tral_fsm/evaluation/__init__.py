"""Drives in batches, and what is measured of them."""
