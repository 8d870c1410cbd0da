"""Small Ackermann cars in corridors: environments, sensors, courses and the road to the real car.

Importing this package registers the environments; it imports nothing heavy.
"""

from gymnasium.envs.registration import register

__version__ = "0.1.0"

register(
    id="TralCorridor-v0",
    entry_point="tral_env.env:TralCorridorEnv",
    vector_entry_point="tral_env.vector_processes:vector_env",
)
register(id="TralCorridorPixels-v0", entry_point="tral_env.env:TralCorridorPixelsEnv")
register(id="TralCar-v0", entry_point="tral_env.hardware.env:TralCarEnv")
