"""Pictures, videos and pages, drawn from data that others have driven."""
