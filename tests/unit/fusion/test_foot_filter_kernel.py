"""The kernel: Jacobians against finite differences, updates against the textbook, covariances that stay covariances."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foottrack_service import rotations as rot
from foottrack_service.fusion.compiled_rotations import rotation
from foottrack_service.fusion.foot_filter_kernel import (
    NE,
    NX,
    inject,
    propagate,
    update1,
    update3,
    update_gyro_bias,
    update_speed,
)
from foottrack_service.fusion.foot_filter_models import attitude_error, point_model
from foottrack_service.rotations import Array

seeds = st.integers(0, 10**6)


def state(random: np.random.Generator) -> Array:
    x = random.normal(size=NX)
    x[6:10] = rot.normalised(random.normal(size=4))
    x[10:16] *= 0.1
    x[16] *= 0.01
    return x


def error_between(a: Array, b: Array) -> Array:
    """The error state that carries a into b."""
    d = np.empty(NE)
    d[:6] = b[:6] - a[:6]
    d[6:9] = rot.to_rotation_vector(rot.multiply(b[6:10], rot.conjugate(a[6:10])))
    d[9:] = b[10:] - a[10:]
    return d


def propagated(x: Array, acc: Array, gyro: Array, dt: float) -> Array:
    moved = x.copy()
    propagate(moved, np.zeros((NE, NE)), acc, gyro, 0.0, False, 0.0, dt)
    return moved


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_the_propagated_covariance_is_that_of_finite_differences(seed: int) -> None:
    random = np.random.default_rng(seed)
    x, acc, gyro, dt = state(random), 10.0 * random.normal(size=3), 3.0 * random.normal(size=3), 1e-3
    F = np.empty((NE, NE))
    base, step = propagated(x, acc, gyro, dt), 1e-6
    for j in range(NE):
        moved = x.copy()
        inject(moved, step * np.eye(NE)[j])
        F[:, j] = error_between(base, propagated(moved, acc, gyro, dt)) / step
    root = random.normal(size=(NE, NE))
    P = root @ root.T
    ours, noise = P.copy(), np.zeros((NE, NE))
    propagate(x.copy(), ours, acc, gyro, 0.0, False, 0.0, dt)
    propagate(x.copy(), noise, acc, gyro, 0.0, False, 0.0, dt)
    assert np.allclose(ours - noise, F @ P @ F.T, atol=2e-4 * np.abs(P).max())
    assert np.allclose(ours, ours.T)


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_the_jacobian_of_a_seen_point(seed: int) -> None:
    random = np.random.default_rng(seed)
    x, arm, rate = state(random), 0.2 * random.normal(size=3), random.normal(size=3)
    h, H, other, unused = np.empty(3), np.empty((3, NE)), np.empty(3), np.empty((3, NE))
    point_model(x, arm, rate, x[16] - 0.002, h, H)
    for j in range(NE):
        moved, step = x.copy(), 1e-7
        inject(moved, step * np.eye(NE)[j])
        point_model(moved, arm, rate, moved[16] - 0.002, other, unused)
        # the turn of the arm's own speed over the few ms of a time offset is left out
        assert np.allclose((other - h) / step, H[:, j], atol=0.05 if 6 <= j < 9 else 1e-5)


def test_a_seen_point_by_hand() -> None:
    x = np.zeros(NX)
    x[:6] = [1.0, 2.0, 3.0, 0.5, 0.0, 0.0]
    x[6:10] = rot.from_yaw(np.pi / 2)
    h, H = np.empty(3), np.empty((3, NE))
    point_model(x, np.array([0.0, 0.0, -0.1]), np.array([0.0, 2.0, 0.0]), 0.01, h, H)
    # the arm points to -X and turns on to +Z with 0.2 m/s
    assert h == pytest.approx([1.0 - 0.1 + 0.005, 2.0, 3.0 + 0.002])
    assert H[:, 15] == pytest.approx([0.5, 0.0, 0.2])


def test_straight_acceleration_by_hand() -> None:
    x = np.zeros(NX)
    x[9] = 1.0
    for _ in range(100):
        propagate(x, np.eye(NE), np.array([1.0, 9.80665, 0.0]), np.zeros(3), 0.0, False, 0.0, 0.01)
    assert x[:6] == pytest.approx([0.5, 0.0, 0.0, 1.0, 0.0, 0.0])


def test_a_turn_by_hand() -> None:
    x = np.zeros(NX)
    x[9] = 1.0
    for _ in range(100):
        propagate(x, np.eye(NE), np.array([0.0, 9.80665, 0.0]), np.array([0.0, 0.5, 0.0]), 0.0, False, 0.02, 0.01)
    assert rot.yaw_of(x[6:10]) == pytest.approx(0.5)
    assert x[:3] == pytest.approx(0.0, abs=1e-12)


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_an_update_is_the_textbook_s(seed: int) -> None:
    random = np.random.default_rng(seed)
    x, root = state(random), random.normal(size=(NE, NE))
    P, H, y = root @ root.T, random.normal(size=(3, NE)), 1e-3 * random.normal(size=3)
    noise = np.diag(random.uniform(0.1, 2.0, 3))
    S = H @ P @ H.T + noise
    K = P @ H.T @ np.linalg.inv(S)
    expected = x.copy()
    inject(expected, K @ y)
    ours, ours_P = x.copy(), P.copy()
    distance = update3(ours, ours_P, H, y, noise, np.inf)
    assert distance == pytest.approx(y @ np.linalg.solve(S, y))
    assert np.allclose(ours, expected)
    joseph = (np.eye(NE) - K @ H) @ P @ (np.eye(NE) - K @ H).T + K @ noise @ K.T
    assert np.allclose(ours_P, joseph, atol=1e-7 * np.abs(P).max())
    one, one_P = x.copy(), P.copy()
    update1(one, one_P, H[0].copy(), y[0], noise[0, 0], np.inf)
    assert np.allclose(one_P, P - np.outer(P @ H[0], P @ H[0]) / (H[0] @ P @ H[0] + noise[0, 0]))


@pytest.mark.parametrize(("update", "part", "in_x"), [(update_speed, 3, 3), (update_gyro_bias, 12, 13)])
def test_a_part_of_the_state_that_is_measured_itself_is_updated_as_any_measurement(
    update: Callable[..., float], part: int, in_x: int
) -> None:
    random = np.random.default_rng(part)
    x, root, measured = state(random), random.normal(size=(NE, NE)), random.normal(size=3)
    P = root @ root.T
    short, short_P, general, general_P = x.copy(), P.copy(), x.copy(), P.copy()
    H = np.eye(NE)[part : part + 3]
    expected = update3(general, general_P, H, measured - x[in_x : in_x + 3], 0.04 * np.eye(3), np.inf)
    assert update(short, short_P, measured, 0.04, np.inf) == pytest.approx(expected)
    assert short == pytest.approx(general)
    assert short_P == pytest.approx(general_P)


def test_a_gate_leaves_everything_as_it_was() -> None:
    x, P, H = np.zeros(NX), np.eye(NE), np.eye(3, NE)
    x[9] = 1.0
    before = x.copy()
    assert update3(x, P, H, np.array([10.0, 0.0, 0.0]), np.eye(3), 16.3) == pytest.approx(50.0)
    assert update1(x, P, H[0].copy(), np.nan, 1.0, 16.3) == np.inf
    assert update3(x, P, H, np.zeros(3), np.diag([1.0, -9.0, 1.0]), 16.3) == np.inf
    assert (x == before).all()
    assert np.array_equal(P, np.eye(NE))


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_rotations_agree_with_the_project_s(seed: int) -> None:
    random = np.random.default_rng(seed)
    x, turn = state(random), 0.5 * random.normal(size=3)
    assert np.allclose(rotation(x[6:10]), rot.to_matrix(x[6:10]))
    other = rot.multiply(rot.from_rotation_vector(turn), x[6:10])
    assert np.allclose(attitude_error(other, x), turn)
    assert np.allclose(attitude_error(-other, x), turn)
