"""What a drive looks like: figures, plots, videos."""
