"""From readings to an estimate of the car and its corridor."""
