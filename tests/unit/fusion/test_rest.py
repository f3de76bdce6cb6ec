"""What a foot at rest shows: the bias of its gyro, and not what it does before a step; nor does a device's own
correction of its tilt make it roll."""

from __future__ import annotations

import math

import numpy as np

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings
from foottrack_service.fusion.foot_filter_events import ZERO_SIGMA
from foottrack_service.fusion.foot_filter_inertial import InertialFilter
from foottrack_service.fusion.interface import ImuSample
from foottrack_service.rotations import Array

STEP_NS = 2_500_000
UP = np.array([0.0, STANDARD_GRAVITY, 0.0])
BIAS = np.array([0.004, -0.008, 0.006])


def begun() -> InertialFilter:
    filter_ = InertialFilter(FootSettings(), "left", floor=True)
    filter_.on_imu(ImuSample(0, UP, BIAS, None))
    return filter_


def feel(filter_: InertialFilter, seconds: float, gyro: Array, shake: float = 0.0) -> None:
    for i in range(round(seconds * 1e9 / STEP_NS)):
        force = UP + [shake * math.sin(0.5 * i), 0.0, 0.0]
        filter_.on_imu(ImuSample(filter_.newest + STEP_NS, force, gyro, None))


def off(filter_: InertialFilter, bias: Array = BIAS) -> float:
    """The largest error of the gyro's bias, deg/s."""
    return float(np.degrees(np.abs(filter_.state[0][13:16] - bias).max()))


def test_how_a_foot_turns_before_a_step_is_not_its_gyros_bias() -> None:
    filter_ = begun()
    feel(filter_, 10.0, BIAS)
    assert off(filter_) < 0.005
    feel(filter_, 0.45, BIAS + np.radians([-2.0, 1.0, 0.0]))
    assert filter_.last_row[ZERO_SIGMA] > 0.0
    feel(filter_, 0.5, BIAS, shake=20.0)
    assert off(filter_) < 0.02


def test_a_bias_that_drifts_as_the_sensor_warms_up_is_followed() -> None:
    filter_ = begun()
    bias = BIAS
    for _ in range(40):
        bias = bias + np.radians([0.0, 0.0025, 0.0])
        feel(filter_, 1.0, bias)
    assert off(filter_, bias) < 0.03


def test_short_stances_show_a_bias_that_is_not_known() -> None:
    filter_ = begun()
    feel(filter_, 0.1, BIAS)
    before = off(filter_)
    for _ in range(12):
        feel(filter_, 0.4, BIAS + [0.0, 1.0, 0.0], shake=20.0)
        feel(filter_, 0.4, BIAS)
    assert off(filter_) < 0.1 * before


def test_a_device_that_corrects_its_tilt_does_not_roll() -> None:
    filter_ = InertialFilter(FootSettings(), "left", floor=True)
    fastest, used = 0.0, 0
    for i in range(1000):
        lean = 0.05 * min(max(i * STEP_NS * 1e-9 - 2.0, 0.0), 0.2)
        filter_.on_imu(ImuSample(i * STEP_NS, UP, None, rot.from_axis_angle([1.0, 0.0, 0.0], lean)))
        fastest = max(fastest, float(np.linalg.norm(filter_.state[0][3:6])))
        used += filter_.last_row[ZERO_SIGMA] > 0.0
    assert used > 900
    assert fastest < 0.007
