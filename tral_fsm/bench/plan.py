"""What `tral bench speed` measures."""

from __future__ import annotations

from dataclasses import dataclass

from tral_env.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class SpeedPlan:
    """What to measure, and for how long."""

    scenario: str = "corners"
    """Family of the courses."""
    rows: tuple[int, ...] = (1, 16, 64, 256, 1024)
    """Numbers of rows of the native vector environment."""
    threads: tuple[int, ...] = (1, 2)
    compared: int = 256
    """Number of rows at which the native vector environment is compared with others, by the last of the threads."""
    scaling: tuple[int, int] | None = (1024, 64)
    """Numbers of rows whose speeds are compared; None: no such comparison."""
    rivals: int = 16
    """Number of environments in Gymnasium's own vector environments."""
    landmarks: tuple[str, ...] = ("Ant-v5", "HalfCheetah-v5")
    """Well-known environments, whose steps have their own length."""
    rounds: int = 3
    seconds: float = 1.0
    """Time of a contestant in a round, s."""
    camera: bool = True
    """Whether to measure the rendered camera too."""
    sizes: bool = True
    """Whether to measure the cost of larger courses too."""

    def __post_init__(self) -> None:
        if not self.threads:
            raise ConfigError("SpeedPlan.threads = (): expected at least one number of threads")
        for name, rows in (("compared", (self.compared,)), ("scaling", self.scaling or ())):
            for count in rows:
                if count not in self.rows:
                    raise ConfigError(f"SpeedPlan.{name}: {count} rows are not among rows = {self.rows}")


QUICK = SpeedPlan(
    rows=(1, 256), threads=(2,), scaling=None, landmarks=("HalfCheetah-v5",), rounds=2, seconds=0.6, sizes=False
)
"""A plan of less than a minute."""
