"""Inertial sensor: true angular rate and acceleration -> what a MEMS chip reads. Batched, without state.

Model: reading = clip(round to the register's unit(truth + bias + white noise)). The bias is drawn once for a drive,
the noise for every reading. Scale and axis errors (3 % and 2 % in the data sheet) are left out.
Source: InvenSense, MPU-9250 product specification PS-MPU-9250A-01, tables 1 and 2.
"""

from __future__ import annotations

import math

import numpy as np

from tral_env.arrays import Array
from tral_env.config import ImuConfig

STANDARD_GRAVITY = 9.80665
"""1 g in m/s^2. Source: CGPM 1901."""
AXES = 6
"""A reading has so many columns."""
UNITS = ("rad/s",) * 3 + ("m/s^2",) * 3
"""Units of the columns: gyroscope about x, y, z, then accelerometer along x, y, z."""

_REGISTER = 1 << 15
"""The register of a reading holds so many steps either way: it has 16 bit."""


def _columns(gyro: float, accel: float) -> Array:
    return np.repeat([gyro, accel], 3)


def noise_sigma(config: ImuConfig) -> Array:
    """Standard deviation of the noise of one reading, (6,): density times the root of the bandwidth."""
    root = math.sqrt(config.bandwidth_hz)
    return _columns(
        math.radians(config.gyro_noise_dps) * root,
        config.accel_noise_ug * 1e-6 * STANDARD_GRAVITY * root,
    )


def full_scale(config: ImuConfig) -> Array:
    """Largest reading either way, (6,) in the units of `UNITS`."""
    return _columns(math.radians(config.gyro_range_dps), config.accel_range_g * STANDARD_GRAVITY)


def draw_bias(normal: Array, config: ImuConfig) -> Array:
    """Draw the bias of a drive from standard normal numbers, (..., 6) -> (..., 6) in the units of `UNITS`."""
    sigma = _columns(math.radians(config.gyro_bias_dps), config.accel_bias_mg * 1e-3 * STANDARD_GRAVITY)
    return normal * sigma


def measure(truth: Array, bias: Array | float, normal: Array, config: ImuConfig) -> Array:
    """Measure as the chip does: ``clip(u rint((truth + bias + noise) / u), -limit, limit - u)``, u a register's unit.

    Args:
        truth: (..., 6) angular rate, rad/s, and proper acceleration, m/s^2 (+9.8 on z for a car that stands), about and
            along the car's axes.
        bias: (..., 6) or 0, see `draw_bias`.
        normal: (..., 6) standard normal numbers.
        config: the chip.

    Returns:
        (..., 6) in the units of `truth`.
    """
    limit = full_scale(config)
    unit = limit / _REGISTER
    raw = truth + bias + normal * noise_sigma(config)
    return np.clip(np.rint(raw / unit) * unit, -limit, limit - unit)
