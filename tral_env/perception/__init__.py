"""From images to markers, and from markers to gates."""
