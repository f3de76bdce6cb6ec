"""Other people's methods on the same recordings. They look at a whole recording; our filter only at what has been."""

from __future__ import annotations

import imufusion
import numpy as np
from scipy.ndimage import binary_dilation, label

from foottrack_service.evaluation.datasets import STANDARD_GRAVITY
from foottrack_service.rotations import Array

_GAIN = 0.5
_GYRO_RANGE = 2000.0
_REJECTION = 10.0
_REJECTION_PERIOD_S = 5.0
_MOVING = 3.0
"""m/s^2."""
_MARGIN_S = 0.1


def ahrs_with_zero_velocity(t: Array, acc: Array, gyro: Array, rate_hz: float) -> Array:
    """Places, m, z up, shape (n, 3): imufusion's attitude, integrated where it moves, each step's drift taken off.

    The method that its makers publish with their recordings (github.com/xioTechnologies/Gait-Tracking). ``t`` s, (n,);
    specific force ``acc`` m/s^2 and ``gyro`` rad/s in the sensor's frame, (n, 3).
    """
    dt = np.diff(t, prepend=t[0])
    moving_acc = _earth_acceleration(dt, acc / STANDARD_GRAVITY, np.degrees(gyro), rate_hz)
    margin = int(_MARGIN_S * rate_hz)
    moving = binary_dilation(np.linalg.norm(moving_acc, axis=1) > _MOVING, np.ones(2 * margin - 1))
    v = np.zeros_like(moving_acc)
    periods, count = label(moving)
    for period in range(1, count + 1):
        inside = np.flatnonzero(periods == period)
        speed = np.cumsum(dt[inside, None] * moving_acc[inside], axis=0)
        share = (t[inside] - t[inside[0]]) / max(t[inside[-1]] - t[inside[0]], 1e-9)
        v[inside] = speed - speed[0] - share[:, None] * (speed[-1] - speed[0])
    places: Array = np.cumsum(dt[:, None] * v, axis=0)
    return places


def rts_smoother(acc: Array, gyro: Array, rate_hz: float) -> Array | None:
    """Places, m, z up, shape (n, 3), by gaitmap's RtsKalman with its own settings; None where gaitmap is not installed.

    ``acc`` m/s^2 and ``gyro`` rad/s, (n, 3), z up. https://gaitmap.readthedocs.io
    """
    try:
        from gaitmap.trajectory_reconstruction import RtsKalman
        from pandas import DataFrame
    except ImportError:
        return None
    columns = [f"{sensor}_{axis}" for sensor in ("acc", "gyr") for axis in "xyz"]
    table = DataFrame(np.hstack([acc, np.degrees(gyro)]), columns=columns)
    found = RtsKalman().estimate(table, sampling_rate_hz=rate_hz)
    places: Array = found.position_[["pos_x", "pos_y", "pos_z"]].to_numpy()[1:]
    return places


def _earth_acceleration(dt: Array, acc_g: Array, gyro_deg: Array, rate_hz: float) -> Array:
    offset, ahrs = imufusion.Offset(round(rate_hz)), imufusion.Ahrs()
    ahrs.settings = imufusion.Settings(
        imufusion.CONVENTION_NWU, _GAIN, _GYRO_RANGE, _REJECTION, 0.0, round(_REJECTION_PERIOD_S * rate_hz)
    )
    found = np.empty_like(acc_g)
    for i, step in enumerate(dt.tolist()):
        ahrs.update_no_magnetometer(offset.update(gyro_deg[i]), acc_g[i], step)
        found[i] = ahrs.earth_acceleration
    return STANDARD_GRAVITY * found
