"""Zero velocity: what stands, what only seems to, and how it adapts to the swing before it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foottrack_service.config import FootSettings
from foottrack_service.fusion.contact import CALM_S, PEAK, QUIET, STILL_SIGMA, see, stance_sigma, stillness
from foottrack_service.fusion.foot_filter_events import ACC, COLUMNS, GYRO, IMU, KIND, MEAN_RATE
from foottrack_service.fusion.foot_filter_inertial import InertialFilter
from foottrack_service.fusion.foot_filter_kernel import GRAVITY, NE, NX
from foottrack_service.fusion.foot_filter_memory import SEEN_KEPT, new_foot
from foottrack_service.fusion.interface import ImuSample
from foottrack_service.rotations import Array

STEP = 5_000_000


def rows(acc: Array, gyro: Array) -> tuple[Array, Array]:
    n = len(acc)
    made = np.zeros((n, COLUMNS))
    made[:, KIND] = IMU
    made[:, ACC : ACC + 3], made[:, GYRO : GYRO + 3] = acc, gyro
    return np.arange(n, dtype=np.int64) * STEP, made


def still(n: int = 40) -> tuple[Array, Array]:
    return rows(np.tile([0.0, GRAVITY, 0.0], (n, 1)), np.zeros((n, 3)))


def upright(tilt_sigma: float = 0.01) -> tuple[Array, Array]:
    x, P = np.zeros(NX), np.zeros((NE, NE))
    x[9] = 1.0
    P[6, 6] = P[8, 8] = tilt_sigma**2
    return x, P


def test_a_known_bias_of_the_accelerometer_moves_nobody() -> None:
    t, made = still()
    made[:, ACC + 1] += 0.6
    assert stillness(t, made, 39)[0] == pytest.approx(2.0)
    assert stillness(t, made, 39, (0.0, 0.6, 0.0))[0] == pytest.approx(0.0, abs=1e-6)
    x, P = upright()
    assert stance_sigma(t, made, 39, 0.0025, x, P, np.zeros(6)) == 0.0
    x[11] = 0.6
    assert stance_sigma(t, made, 39, 0.0025, x, P, np.zeros(6)) > 0.0


def test_the_statistic_by_hand() -> None:
    t, made = still()
    statistic, mean, _ = stillness(t, made, 39)
    assert statistic == pytest.approx(0.0, abs=1e-6)
    assert mean == pytest.approx((0.0, GRAVITY, 0.0))
    made[:, GYRO] = 0.3
    assert stillness(t, made, 39)[0] == pytest.approx(1.0)
    made[:, GYRO] = 0.0
    made[::2, ACC] += 0.3
    made[1::2, ACC] -= 0.3
    assert stillness(t, made, 39)[0] == pytest.approx(1.0, rel=0.05)


def test_there_is_none_before_a_whole_window() -> None:
    t, made = still()
    assert stillness(t, made, 15)[0] == math.inf
    assert math.isfinite(stillness(t, made, 17)[0])


def test_rates_of_a_device_s_own_attitude_are_averaged() -> None:
    t, made = still()
    made[::2, GYRO] = 1.0
    made[1::2, GYRO] = -1.0
    gyro = stillness(t, made, 39)[0]
    made[:, MEAN_RATE] = 1.0
    assert gyro > 3.0
    assert stillness(t, made, 39)[0] < 0.6


def test_a_still_foot_stands_and_a_swinging_one_does_not() -> None:
    t, made = still()
    assert stance_sigma(t, made, 39, 0.005, *upright(), np.zeros(6)) == pytest.approx(STILL_SIGMA, abs=1e-6)
    made[:, GYRO] = 2.0
    assert stance_sigma(t, made, 39, 0.005, *upright(), np.zeros(6)) == 0.0


def test_a_runner_s_stance_counts_against_the_swing_before_it_but_less() -> None:
    t, made = still()
    made[:, GYRO] = 0.9  # a statistic of 3
    assert stance_sigma(t, made, 39, 0.005, *upright(), np.zeros(6)) == 0.0
    after_a_swing = np.zeros(6)
    after_a_swing[PEAK] = 50.0
    assert stance_sigma(t, made, 39, 0.005, *upright(), after_a_swing) > 5.0 * STILL_SIGMA


def test_a_smooth_push_is_no_stance_until_it_has_lasted_too_long_to_be_one() -> None:
    t, made = still()
    made[:, ACC] = 1.5  # 0.1 m/s^2 in the norm
    x, P = upright()
    assert stillness(t, made, 39)[0] < QUIET
    memory = np.zeros(6)
    assert stance_sigma(t, made, 39, 0.005, x, P, memory) == 0.0
    assert stance_sigma(t, made, 39, 0.005, *upright(0.1), np.zeros(6)) > 0.0
    found = [stance_sigma(t, made, 39, 0.005, x, P, memory) for _ in range(250)]
    assert found[100] == 0.0
    assert found[-1] > 0.0


def test_fixes_that_move_say_how_fast() -> None:
    foot = new_foot()
    for i in range(12):
        see(foot[0], i * 16_000_000, np.array([0.1 * 0.016 * i, 0.0, 0.0]))
    assert foot["seen_speed"] == pytest.approx(0.1)
    for i in range(12, 40):
        see(foot[0], i * 16_000_000, np.array([0.02, 0.001 * (i % 2), 0.0]))
    assert foot["seen_speed"] == 0.0


def test_more_fixes_than_are_kept_show_the_newest_motion() -> None:
    foot = new_foot()
    for i in range(2 * SEEN_KEPT):
        see(foot[0], i * 3_000_000, np.array([0.0, 0.0, 0.2 * 0.003 * i]))
    assert foot["seen"] == SEEN_KEPT
    assert foot["seen_speed"] == pytest.approx(0.2)


def test_a_speed_that_no_stance_has_is_believed_for_as_long_as_a_swing_may_be_calm() -> None:
    t, made = still()
    made[:, GYRO] = 0.9
    x, P = upright()
    x[3] = 1.5
    P[3:6, 3:6] = 0.05**2 * np.eye(3)
    memory = np.zeros(6)
    memory[PEAK] = 100.0
    found = [stance_sigma(t, made, 39, 0.005, x, P, memory) for _ in range(60)]
    assert np.count_nonzero(found) == 60 - round(CALM_S / 0.005) + 1
    assert all(found[-5:])
    P[3:6, 3:6] = np.eye(3)
    assert stance_sigma(t, made, 39, 0.005, x, P, memory) > 0.0
    P[3:6, 3:6] = 0.05**2 * np.eye(3)
    assert stance_sigma(t, made, 39, 0.005, x, P, memory) == 0.0


def test_a_swing_that_is_calm_beside_impacts_is_no_stance() -> None:
    filter_ = InertialFilter(FootSettings(), "left", floor=True)
    for i in range(800):
        t = 0.0025 * i
        force, rate = np.array([0.0, GRAVITY, 0.0]), 0.0
        if 1.0 <= t < 1.02:
            force[0] = 80.0 * (-1.0) ** i
        elif 1.5 <= t < 1.6:
            force[0] = 10.0
        elif t >= 1.6:
            rate = 1.2
        filter_.on_imu(ImuSample(round(t * 1e9), force, np.array([0.0, rate, 0.0]), None))
        if t >= 1.8:
            break
    assert float(np.linalg.norm(filter_.state[0][3:6])) == pytest.approx(1.0, abs=0.05)
