"""Layered layout of the states and arrows of a picture."""
