"""Gains from classical control theory."""
