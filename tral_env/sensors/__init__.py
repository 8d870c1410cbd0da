"""Physical values to readings: batched laws of the sensors."""
