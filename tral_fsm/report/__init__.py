"""Pictures, videos and pages; the rooms below drive, this one draws their data."""
