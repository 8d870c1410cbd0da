"""Where the states and arrows of a picture stand."""
