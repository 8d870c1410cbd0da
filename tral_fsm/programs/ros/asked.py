"""What a command line or a file of parameters asks of the nodes; it is read without Cyclone DDS."""

from __future__ import annotations

from dataclasses import dataclass

from tral_env.errors import ConfigError
from tral_env.ros.patience import CAMERA_TIMEOUT_S, COMMAND_TIMEOUT_S, check_patience


@dataclass(frozen=True, kw_only=True)
class Asked:
    """The parameters of all nodes. Each node looks at its own."""

    backend: str = "simulation"
    config: str = "car.toml"
    """Car file of the backend "car"."""
    dry: bool = False
    """Whether the real car's pulses are only recorded."""
    scenario: str = "office"
    course: str | None = None
    seed: int = 7
    randomization: str = "default"
    camera: str = "projected"
    namespace: str = ""
    use_sim_time: bool = False
    lock_step: bool = False
    arm: bool = False
    command_timeout: float = COMMAND_TIMEOUT_S
    camera_timeout: float = CAMERA_TIMEOUT_S
    policy: str = "office"
    source: str = ""
    """Camera of the node `camera`: a number, a path or a URL; empty: that of the backend."""

    def __post_init__(self) -> None:
        """Refuse what does not fit together, before a car is opened."""
        check_patience("command_timeout", self.command_timeout)
        check_patience("camera_timeout", self.camera_timeout)
        simulated_time = self.use_sim_time or self.lock_step
        if simulated_time and self.backend != "simulation":
            raise ConfigError(f"use_sim_time: the backend '{self.backend}' lives in real time")
        if simulated_time and self.camera == "rendered":
            raise ConfigError("use_sim_time: rendered images come in real time: leave one of both away")
        if self.camera not in ("projected", "rendered"):
            raise ConfigError(f"camera = '{self.camera}'. Allowed: projected, rendered")
        if self.dry and self.backend != "car":
            raise ConfigError(f"dry: the backend '{self.backend}' moves no real car; leave it away")
