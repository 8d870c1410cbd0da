"""How a learner meets the car: what it sees of the readings, how often it decides, and what its decision means.

Training, environments, policy files and the real car share this code, so that a policy sees everywhere what it saw when
it learned. Every array has the cars along its first axis; n is the number of cars.
"""

from tral_env.learner.actuation import Actuation, check_correction, inverse, speed_factors, steered
from tral_env.learner.config import LearnerConfig, pair
from tral_env.learner.features import feature_names
from tral_env.learner.view import LearnerView

__all__ = [
    "Actuation",
    "LearnerConfig",
    "LearnerView",
    "check_correction",
    "feature_names",
    "inverse",
    "pair",
    "speed_factors",
    "steered",
]
