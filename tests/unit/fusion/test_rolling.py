"""A foot that rolls over its ball while it is quiet, and accelerometers that repeat themselves by chance."""

from __future__ import annotations

import math

import numpy as np

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service import rotations as rot
from foottrack_service.body.skeleton import BALL_SHARE
from foottrack_service.config import FootSettings
from foottrack_service.fusion.foot_filter_events import CLIPPED, ZERO_SIGMA
from foottrack_service.fusion.foot_filter_inertial import InertialFilter
from foottrack_service.fusion.interface import ImuSample

STEP_NS = 2_500_000
UP = np.array([0.0, STANDARD_GRAVITY, 0.0])


def standing(seconds: float) -> InertialFilter:
    filter_ = InertialFilter(FootSettings(), "left", floor=True)
    for i in range(round(seconds * 1e9 / STEP_NS)):
        filter_.on_imu(ImuSample(i * STEP_NS, UP, np.zeros(3), None))
    return filter_


def test_a_heel_that_rises_slowly_is_not_held_down() -> None:
    filter_ = standing(2.0)
    settings = FootSettings()
    ball = np.array([0.0, -settings.ankle_height, BALL_SHARE * settings.toe.p[2]])
    first = filter_.state[0][:3].copy()
    # 0.25 rad/s about the ball after a smooth start of 0.1 s: the ankle rises at 3 cm/s, and all is quiet.
    rate, begins, start = 0.25, filter_.newest, 0.1
    worst, used = 0.0, 0
    for i in range(1, 160):
        s = i * STEP_NS * 1e-9
        share = min(s / start, 1.0)
        angle = rate * (s * share / 2.0 if s < start else s - start / 2.0)
        turning, faster = rate * share, rate / start if s < start else 0.0
        q = rot.from_axis_angle([1.0, 0.0, 0.0], -angle)
        arm = rot.rotate(q, -ball)
        a = np.cross([-faster, 0.0, 0.0], arm) + np.cross([-turning, 0.0, 0.0], np.cross([-turning, 0.0, 0.0], arm))
        filter_.on_imu(ImuSample(begins + i * STEP_NS, rot.unrotate(q, a + UP), np.array([-turning, 0.0, 0.0]), None))
        true = np.cross([-turning, 0.0, 0.0], arm)
        worst = max(worst, float(np.linalg.norm(filter_.state[0][3:6] - true)))
        used += filter_.last_row[ZERO_SIGMA] > 0.0
    assert used > 100
    assert math.isclose(filter_.state[0][1] - first[1], float((arm + ball)[1]), abs_tol=2e-3)
    assert worst < 0.002


def test_a_force_that_repeats_is_clipped_only_at_the_strongest_ever() -> None:
    filter_ = standing(0.5)

    def feel(force: float, times: int) -> float:
        for _ in range(times):
            filter_.on_imu(ImuSample(filter_.newest + STEP_NS, np.array([0.0, force, 0.0]), np.zeros(3), None))
        return float(filter_.last_row[CLIPPED])

    assert feel(30.0, 1) == 0.0
    assert feel(12.0, 5) == 0.0
    assert feel(31.0, 3) == 1.0  # an accelerometer whose end is nowhere near a full scale we know
    assert feel(39.0, 1) == 1.0  # 4 g ...
    assert feel(45.0, 1) == 0.0
    assert feel(39.0, 1) == 0.0  # ... is not this one's end


def test_one_damaged_sample_does_not_hide_an_accelerometer_s_end_for_good() -> None:
    filter_ = standing(0.5)
    force = np.array([0.0, 900.0, 0.0])
    filter_.on_imu(ImuSample(filter_.newest + STEP_NS, force, np.zeros(3), None))
    ends, step_ns = [], 20_000_000
    for _ in range(4):
        for _ in range(round(600e9 / step_ns)):
            filter_.on_imu(ImuSample(filter_.newest + step_ns, UP, np.zeros(3), None))
        filter_.on_imu(ImuSample(filter_.newest + step_ns, np.array([0.0, 78.4, 0.0]), np.zeros(3), None))
        ends.append(float(filter_.last_row[CLIPPED]))
    assert ends == [0.0, 0.0, 1.0, 1.0]
