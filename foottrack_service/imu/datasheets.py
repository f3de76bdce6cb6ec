"""Noise densities of common chips, typical figures of their data sheets."""

from __future__ import annotations

import math
from typing import NamedTuple

from foottrack_protocol.frames import STANDARD_GRAVITY


class NoiseDensity(NamedTuple):
    """Angle random walk [rad/s/sqrt(Hz)] and velocity random walk [m/s^2/sqrt(Hz)]."""

    gyro: float
    acc: float


def noise_density(gyro_mdps: float, acc_ug: float) -> NoiseDensity:
    """From a data sheet's units: mdeg/s/sqrt(Hz) and ug/sqrt(Hz)."""
    return NoiseDensity(math.radians(gyro_mdps * 1e-3), acc_ug * 1e-6 * STANDARD_GRAVITY)


CHIPS = {
    "bmi055": noise_density(14.0, 150.0),
    "bmi160": noise_density(7.0, 180.0),
    "bmi270": noise_density(8.0, 160.0),
    "icm20948": noise_density(15.0, 230.0),
    "icm42688": noise_density(2.8, 70.0),
    "lsm6dsox": noise_density(3.8, 70.0),
    "lsm6dsr": noise_density(5.0, 60.0),
    "mpu6050": noise_density(5.0, 400.0),
}
