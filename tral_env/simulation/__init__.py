"""The MuJoCo cars: the only stepper, and pictures of it."""
