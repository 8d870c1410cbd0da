"""The car in the browser, at work: a drive that can be paused and changed, and the page that shows it."""
