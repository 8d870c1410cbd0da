"""Text to definition and back, one module a format."""
