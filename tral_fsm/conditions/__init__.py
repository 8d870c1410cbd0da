"""When transitions fire."""
