"""What must be noticed while the car drives: laws on readings, commands and a clock, without any device.

They stop the car or warn in the policy's process; the actuator's guard stays the last word.
"""

from tral_env.hardware.faults.limits import FaultLimits
from tral_env.hardware.faults.look import Look
from tral_env.hardware.faults.names import FAULTS, Decision, Fault, Finding
from tral_env.hardware.faults.watch import FaultWatch

__all__ = ["FAULTS", "Decision", "Fault", "FaultLimits", "FaultWatch", "Finding", "Look"]
