"""From physical values to readings: batched models of the sensors, without any physics engine."""
