"""Images to gates and markers."""
