"""What may be true of a person, a shoe, a sensor or a stage: what is beyond would only break the numbers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from foottrack_protocol.messages import (
    BodyCalibration,
    FloorCalibration,
    HeadingCalibration,
    ImuCalibration,
    MountCalibration,
)

MOST_DISTANCE = 1000.0
"""m: nothing is further from the stage's origin."""
MOST_YAW = 100.0
"""rad: turns may be counted."""
LEAST_LENGTH, MOST_LENGTH = 0.01, 3.0
"""m: of bones, and of what is between the parts of a body, a headset or a shoe."""
MOST_TURN_SIGMA = 3.2
"""rad: who knows less knows nothing."""
MOST_ACC_BIAS, MOST_GYRO_BIAS = 10.0, 10.0
"""m/s^2, rad/s: ten times what the worst sensors have."""


def within(values: Iterable[float | None], most: float) -> bool:
    """Whether none is further from zero than ``most``; what is not given never is."""
    return all(value is None or abs(value) <= most for value in values)


def is_plausible(found: Any) -> bool:
    """Whether the body of a ``calibration`` message can be what somebody found."""
    values = found.values
    if isinstance(found, FloorCalibration):
        return within((values.height,), MOST_DISTANCE)
    if isinstance(found, HeadingCalibration):
        return within((values.yaw, values.imu_yaw.left, values.imu_yaw.right), MOST_YAW)
    if isinstance(found, BodyCalibration):
        lengths = (values.height, values.thigh, values.shank, values.torso, values.hip_width, values.neck_down)
        backs = (values.hip_back, values.neck_back)
        return within((*lengths, *backs), MOST_LENGTH) and all(each is None or each >= LEAST_LENGTH for each in lengths)
    if isinstance(found, MountCalibration):
        return within((*values.p, values.sigma_p), MOST_LENGTH) and within((values.sigma_q,), MOST_TURN_SIGMA)
    if isinstance(found, ImuCalibration):
        biases = within(values.acc_bias, MOST_ACC_BIAS) and within(values.gyro_bias, MOST_GYRO_BIAS)
        return biases and within(values.p, MOST_LENGTH)
    return False
