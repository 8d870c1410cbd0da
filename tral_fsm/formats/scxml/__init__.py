"""State charts of the W3C."""
